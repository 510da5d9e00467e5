"""Ranges of numbers that several sections of acqd.toml have."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

Port = Annotated[int, Field(ge=1, le=65_535)]
Positive = Annotated[float, Field(gt=0)]
Share = Annotated[float, Field(ge=0, le=1)]
Nominal = Annotated[float, Field(ge=45, le=65)]
"""Nominal mains frequency [Hz]."""
