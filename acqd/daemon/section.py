"""Ranges of numbers that several sections of acqd.toml have."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, Field

from acqd.metering.block import NOMINAL, NOMINAL_TEXT
from acqd.telemetry.ports import bare_host


def _metered(f: float) -> float:
    if not any(low <= f <= high for low, high in NOMINAL):
        raise ValueError(NOMINAL_TEXT)
    return f


def _printable(text: str) -> str:
    if not text.replace("\0", "").isprintable():  # NUL has a line of its own
        raise ValueError("holds a character that cannot be printed: brokers end a connection that sends one")
    return text


Host = Annotated[str, Field(min_length=1), AfterValidator(bare_host)]
"""Name or address of a computer."""
BrokerName = Annotated[str, AfterValidator(_printable)]
"""What a broker knows a client by."""
Port = Annotated[int, Field(ge=1, le=65_535)]
Positive = Annotated[float, Field(gt=0)]
Share = Annotated[float, Field(ge=0, le=1)]
Nominal = Annotated[float, AfterValidator(_metered)]
"""Nominal mains frequency [Hz]."""
