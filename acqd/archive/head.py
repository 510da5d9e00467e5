"""What a segment says about its samples, so that they can be metered again: format, source, metering, state."""

from __future__ import annotations

import json
import zlib
from dataclasses import asdict, dataclass, field
from typing import Any

from acqd.metering import StreamFormat

SCHEMA = 1
STARTED, FOLLOWS = "start", "next"
"""Why a segment begins: acqd has started; the one before it was long enough. Others: what kept samples away."""
_LARGEST_STATE = 1 << 26


@dataclass(frozen=True, slots=True)
class Metering:
    """How the daemon made rows of the samples."""

    window: float
    """s."""
    mode: str
    nominal_voltage: float
    """V."""
    creep_W: float
    """W per phase."""


@dataclass(frozen=True, slots=True)
class Origin:
    """Where samples come from, and how they were metered: the same for all segments of one stream."""

    device: str
    form: StreamFormat
    """Of the samples as the source delivers them."""
    kind: str
    """Of the source."""
    stages: dict[str, Any]
    """Settings of the stages between source and meter: `correction` and `wiring` of [source]."""
    metering: Metering
    version: str
    """Of acqd."""
    kernel: str
    """What metered: "c" with the instruction set, or "numpy"."""


@dataclass(frozen=True, slots=True)
class Head:
    """The first record of a segment."""

    number: int
    """Of the segment in its archive; rises by one."""
    origin: Origin
    boot: str
    """Of the rows of its first window."""
    index: int
    """Number of the first sample in its stream."""
    utc_ns: int
    """Of the first sample."""
    after: int = 0
    """Number of the segment before it in the same stream; 0: none."""
    begins: str = STARTED
    """Why the segment begins."""
    schema: int = field(default=SCHEMA)

    def to_json(self) -> bytes:
        """The record's content."""
        return json.dumps(asdict(self)).encode()

    @staticmethod
    def parse(body: bytes) -> Head:
        """Raises ValueError that says what is wrong."""
        try:
            data = json.loads(body)
            if data["schema"] != SCHEMA:
                raise ValueError(f"schema {data['schema']!r}; this acqd reads {SCHEMA}")
            origin = data["origin"]
            form = origin["form"]
            origin["form"] = StreamFormat(**form | {"scale": tuple(form["scale"])})
            origin["metering"] = Metering(**origin["metering"])
            data["origin"] = Origin(**origin)
            head = Head(**data)
            whole = all(isinstance(each, int) for each in (head.number, head.index, head.utc_ns, head.after))
            words = (head.boot, head.begins, head.origin.device)
            if not whole or not all(isinstance(each, str) for each in words):
                raise ValueError("a number or a name is none")
        except (KeyError, TypeError, AttributeError) as error:
            raise ValueError(f"its head lacks or misnames something ({error!r})") from None
        return head


def packed_state(state: dict[str, Any]) -> bytes:
    """The content of the record STATE."""
    return zlib.compress(json.dumps(state).encode(), 1)


def unpacked_state(body: bytes) -> dict[str, Any]:
    """The state. Raises ValueError."""
    try:
        text = zlib.decompressobj().decompress(body, _LARGEST_STATE)
    except zlib.error as error:
        raise ValueError(f"its state cannot be unpacked ({error})") from None
    state = json.loads(text)
    if not isinstance(state, dict):
        raise ValueError("its state is no table")
    return state
