"""What stands between the mains and the codes: converter and transformers, as a file describes them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, ValidationError, model_validator

from acqd.arrays import Floats
from acqd.errors import InputError, in_our_words
from acqd.metering.block import Codes, StreamFormat
from acqd.section import Section
from acqd.toml_file import tables_of

_Positive = Annotated[float, Field(gt=0, le=1e6)]
_Percent = Annotated[float, Field(ge=0, le=100)]
_NARROW, _WIDE = 15, 26
"""Bits of the largest code of 16- and 32-bit formats."""
TransformerClass = Literal["0.1", "0.2", "0.2S", "0.5", "0.5S", "1"]


class Uncertainty(Section):
    """Limits of error of the converter, as its data sheet states them; rectangular distributions."""

    gain_percent: _Percent = 0.0
    """Of the reading."""
    offset_percent: _Percent = 0.0
    """Of the end of the measuring range."""
    temperature_ppm_per_k: Annotated[float, Field(ge=0, le=10_000)] = 0.0
    """Drift of the gain."""
    temperature_range_k: Annotated[float, Field(ge=0, le=200)] = 0.0
    """Largest distance from the temperature of the calibration."""
    clock_ppm: Annotated[float, Field(ge=0, le=10_000)] = 0.0
    """Of the sampling rate."""
    delay_us: Annotated[float, Field(ge=0, le=1_000)] = 0.0
    """Between a voltage and its current."""


class Transformers(Section):
    """Classes of the transformers in front of the converter."""

    voltage: Literal["0.1", "0.2", "0.5", "1"] | None = None
    """IEC 61869-3."""
    current: TransformerClass | None = None
    """IEC 61869-2."""


class Terminal(Section):
    """A terminal of three phases; the defaults are an EL3783 in its range of 5 A, on mains of 230 V and 50 Hz."""

    name: Annotated[str, Field(min_length=1, max_length=64)] = "EL3783"
    rate: Annotated[float, Field(ge=2_000, le=200_000)] = 20_000.0
    """Samples/s."""
    bits: Annotated[int, Field(ge=8, le=24)] = 16
    range_v: _Positive = 737.2575
    """V: peak at the end of the measuring range."""
    range_a: _Positive = 9.207527
    """A: peak at the end of the measuring range."""
    noise_digits: Annotated[float, Field(ge=0, le=1_000)] = 0.5
    """RMS of the converter's noise, in its steps."""
    f_nominal: Literal[50, 60] = 50
    """Hz."""
    declared_voltage: _Positive = 230.0
    """V: Udin."""
    nominal_current: _Positive = 5.0
    """A: In of the energy meter's table."""
    max_current: _Positive = 6.0
    """A: Imax of the energy meter's table."""
    uncertainty: Uncertainty | None = None
    """Described limits of the converter: without them there is no uncertainty budget."""
    transformers: Transformers = Transformers()

    @model_validator(mode="after")
    def _usable(self) -> Terminal:
        if self.max_current < self.nominal_current:
            raise ValueError("max_current is below nominal_current")
        if self.max_current * np.sqrt(2) > self.range_a:
            raise ValueError(f"max_current {self.max_current:g} A has a peak beyond the range of {self.range_a:g} A")
        if 1.15 * self.declared_voltage * np.sqrt(2) > self.range_v:
            raise ValueError(f"115 % of {self.declared_voltage:g} V have a peak beyond the range of {self.range_v:g} V")
        return self

    @property
    def described(self) -> bool:
        """Whether converter or transformers are described."""
        return self.uncertainty is not None or bool(self.transformers.voltage or self.transformers.current)

    @property
    def form(self) -> StreamFormat:
        """What the codes mean."""
        full = 2.0**self._full_bits
        scale = (self.range_v / full, self.range_a / full) * 3
        return StreamFormat(self.rate, scale, float(self.f_nominal), 16 if self._full_bits == _NARROW else 32)

    @property
    def _full_bits(self) -> int:
        return _NARROW if self.bits <= _NARROW + 1 else _WIDE

    @property
    def samples_per_window(self) -> int:
        """Of the daemon's window: two cycles of the nominal frequency at least 40 ms."""
        return round(self.window * self.rate)

    @property
    def window(self) -> float:
        """s."""
        return 0.04 if self.f_nominal == 50 else 0.05

    def codes(self, samples: Floats, seed: int) -> Codes:
        """Codes of `samples` [samples, 6] in V and A, with the converter's noise and end stops."""
        form, step = self.form, 2.0 ** (self._full_bits + 1 - self.bits)
        digits = samples / (np.asarray(form.scale) * step)
        digits += self.noise_digits * np.random.default_rng(seed).standard_normal(samples.shape)
        codes = np.clip(np.rint(digits) * step, form.code_min, form.code_max)
        return codes.astype(form.dtype)


def load_terminal(path: Path) -> Terminal:
    """Read a description. Raises InputError with one line that names the key."""
    try:
        data = tables_of(path)
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror})") from None
    try:
        return Terminal.model_validate(data)
    except ValidationError as error:
        raise InputError(path, "; ".join(_complaint(fault) for fault in error.errors())) from None


def _complaint(fault: object) -> str:
    assert isinstance(fault, dict)
    key, text = ".".join(map(str, fault["loc"])), in_our_words(str(fault["msg"]))
    if fault["type"] == "extra_forbidden":
        return f"unknown key {key}; docs/conformance.md lists the keys"
    return f"{key}: {text}" if key else text
