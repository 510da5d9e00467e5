"""Messages of a production system, written into the file of marks."""

from __future__ import annotations

import json
import logging
import re
import time
from collections.abc import Callable, Iterable, Sequence
from datetime import datetime

from acqd.integrations.marks.file import MarksFile
from acqd.integrations.marks.section import DEVICE, MarksSection, MarkTopic
from acqd.telemetry.message import Message
from acqd.telemetry.topics import valid_device

_log = logging.getLogger(__name__)
_LONGEST = 200
"""Letters of a value."""
_AHEAD_NS = 60_000_000_000
"""By which a time may be in the future: a clock that is wrong would hide every mark that follows."""
_MILLISECONDS = 1e11
"""Unix times from here on are in ms."""


class _Number(str):
    """As the payload writes it: a serial number keeps all of its digits, and 12.50 is another version than 12.5."""

    __slots__ = ()


class MarksWriter:
    """A bridge that only listens."""

    def __init__(self, section: MarksSection, file: MarksFile, clock: Callable[[], int] = time.time_ns) -> None:
        self._section, self._file, self._clock = section, file, clock
        self._patterns = [(_pattern(each), each) for each in section.topics]
        self._said: set[str] = set()
        self.refused = 0
        """Messages without a value or with a time that cannot be."""

    def subscriptions(self) -> Sequence[str]:
        """Topics of the section, with + for a device."""
        return [each.topic.replace(DEVICE, "+") for each in self._section.topics]

    def will(self) -> None:
        """None: nothing is published."""

    def begin(self) -> Iterable[Message]:
        """A new connection: what was known before a break has ended with it."""
        self._file.beat(self._clock())
        return ()

    def take(self, topic: str, payload: bytes) -> Iterable[Message]:
        """What a device works on."""
        for pattern, of in self._patterns:
            if match := pattern.fullmatch(topic):
                self._take(topic, payload, of, of.device or match.group(1))
        return ()

    def tick(self) -> Iterable[Message]:
        """What is known still holds."""
        self._file.beat(self._clock())
        return ()

    def close(self) -> None:
        """From now on nobody listens."""
        self._file.forget(self._clock())

    def _take(self, topic: str, payload: bytes, of: MarkTopic, device: str) -> None:
        if not valid_device(device):
            self._refuse(topic, f"{device!r:.40} cannot be the name of a device, left out")
            return
        now_ns = self._clock()
        value, at = self._content(payload)
        if value is None:
            self._refuse(topic, f"expected a text, a number, or an object with {self._section.value!r}")
            return
        at_ns = now_ns
        if at is not None:
            given_ns = _unix_ns(at)
            if given_ns is None or given_ns > now_ns + _AHEAD_NS:
                self._refuse(topic, f"time {at!r:.40} is no time, or in the future: the time of arrival counts")
            else:
                at_ns = given_ns
        if not self._file.put(device, of.kind, value, at_ns):
            self._refuse(topic, "older than the message before, left out")

    def _content(self, payload: bytes) -> tuple[str | None, object]:
        """The value ("" for nothing, None if the message has no value), and its time (None if it has no time)."""
        try:
            text = payload.decode()
        except UnicodeDecodeError:
            return None, None
        try:
            content = json.loads(text, parse_int=_Number, parse_float=_Number, parse_constant=_Number)
        except (json.JSONDecodeError, RecursionError):
            content = text
        at = None
        if isinstance(content, dict):
            if self._section.value not in content:
                return None, None
            content, at = content[self._section.value], content.get(self._section.time)
        if content is None:
            return "", at
        if isinstance(content, (dict, list)):
            return None, None
        shown = str(content).encode(errors="replace").decode()  # JSON can write half of a surrogate pair
        return " ".join(shown.split())[:_LONGEST], at

    def _refuse(self, topic: str, why: str) -> None:
        self.refused += 1
        if (line := f"{topic}: {why}") not in self._said and len(self._said) < 100:
            self._said.add(line)
            _log.warning("%s", line)


def _pattern(each: MarkTopic) -> re.Pattern[str]:
    return re.compile("/".join("([^/]+)" if level == DEVICE else re.escape(level) for level in each.topic.split("/")))


def _unix_ns(at: object) -> int | None:
    """Of RFC 3339 with an offset, or of Unix s or ms."""
    if isinstance(at, _Number):
        seconds = float(at) / 1000 if abs(float(at)) > _MILLISECONDS else float(at)
        return round(1e9 * seconds) if 0 <= seconds < 1e10 else None
    try:
        moment = datetime.fromisoformat(str(at))
    except ValueError:
        return None
    return None if moment.tzinfo is None else int(moment.timestamp()) * 10**9 + 1000 * moment.microsecond
