"""`[marks]` of acqd.toml."""

from __future__ import annotations

import re
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from acqd.section import FileName, Section
from acqd.telemetry.topics import valid_device

DEVICE = "{device}"


def _single(topic: str) -> str:
    """A topic of one device, or of any. Raises ValueError for a filter, and for what no topic can be."""
    if not topic or re.search(r"[+#\x00-\x1f\x7f]", topic):
        raise ValueError(f"expected a topic without +, # and control characters; {DEVICE} stands for a level")
    return topic


class MarkTopic(Section):
    """A topic that says what a device works on."""

    topic: Annotated[str, AfterValidator(_single)]
    """One level may be {device}."""
    kind: Literal["program", "step", "part", "state"]
    device: str = ""
    """Where the topic has no {device}."""

    @model_validator(mode="after")
    def _of_a_device(self) -> Self:
        levels = self.topic.split("/")
        if (DEVICE in levels) == bool(self.device) or levels.count(DEVICE) > 1 or "{" in self.topic.replace(DEVICE, ""):
            raise ValueError(f"topic {self.topic!r}: expected one level {DEVICE}, or a key device beside it")
        if self.device and not valid_device(self.device):
            raise ValueError(f"device {self.device!r}: expected 1 to 64 letters, digits, dots, dashes or underscores")
        return self


class MarksSection(Section):
    """What `acqd bridge marks` writes down, and `acqd energy --by part` reads."""

    in_working_folder = ("file",)
    file: FileName | None = None
    """CSV file of time, device, program, step, part, state."""
    topics: list[MarkTopic] = Field(default=[])
    value: str = "value"
    """Key of the value in a message that is a JSON object."""
    time: str = "time"
    """Key of its time there: RFC 3339 with an offset, or Unix s or ms."""


TABLES = {"marks": MarksSection}
