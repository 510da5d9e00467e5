"""What all sections of acqd.toml are made of: the strict base model, ranges of numbers, keys of devices."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from acqd.sources.spec import Spec, spec_of

Port = Annotated[int, Field(ge=1, le=65_535, strict=True)]
Positive = Annotated[float, Field(gt=0)]
Share = Annotated[float, Field(ge=0, le=1)]
Nominal = Annotated[float, Field(ge=45, le=65)]
"""Nominal mains frequency [Hz]."""


class Section(BaseModel):
    """A table of the file: unknown keys are mistakes."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)


class DeviceSection(Section):
    """Keys of every device that may measure behind transformers."""

    f_nominal: Nominal = 50.0
    vt_ratio: Positive = 1.0
    ct_ratio: Positive = 1.0
    simulated: bool = False

    @property
    def nominal_frequency(self) -> float:
        """Hz."""
        return self.f_nominal

    def spec(self) -> Spec:
        """The source as JSON, for MAIN_FAST's process."""
        return spec_of(**self.model_dump())
