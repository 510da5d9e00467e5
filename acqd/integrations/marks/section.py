"""`[marks]` of acqd.toml."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from acqd.section import FileName, Section

DEVICE = "{device}"


class MarkTopic(Section):
    """A topic that says what a device works on."""

    topic: Annotated[str, Field(pattern=r"^[^+#\s]+$")]
    """One level may be {device}."""
    kind: Literal["program", "step", "part", "state"]
    device: str = ""
    """Where the topic has no {device}."""

    @model_validator(mode="after")
    def _of_a_device(self) -> Self:
        levels = self.topic.split("/")
        if (DEVICE in levels) == bool(self.device) or levels.count(DEVICE) > 1 or "{" in self.topic.replace(DEVICE, ""):
            raise ValueError(f"topic {self.topic!r}: expected one level {DEVICE}, or a key device beside it")
        return self


class MarksSection(Section):
    """What `acqd bridge marks` writes down, and `acqd energy --by part` reads."""

    file: FileName | None = None
    """CSV file of time, device, program, step, part, state."""
    topics: list[MarkTopic] = Field(default=[])
    value: str = "value"
    """Key of the value in a message that is a JSON object."""
    time: str = "time"
    """Key of its time there: RFC 3339 with an offset, or Unix s or ms."""


TABLES = {"marks": MarksSection}
