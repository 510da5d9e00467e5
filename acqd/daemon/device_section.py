"""Keys that many kinds of `[source]` share."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

from acqd.daemon.correction_section import CorrectionSection
from acqd.daemon.section import Nominal, Positive
from acqd.errors import SettingError
from acqd.metering import StreamFormat
from acqd.metering.stages import Stage
from acqd.metering.wiring import Aron
from acqd.section import Section
from acqd.sources.spec import Spec, spec_of

NOT_OF_THE_SOURCE = {"correction", "wiring", "nominal_voltage"}
"""Keys that concern the samples after MAIN_FAST."""


class WaveformKeys(Section):
    """Keys of everything that delivers samples."""

    correction: CorrectionSection = CorrectionSection()
    wiring: Literal["star", "aron"] = "star"
    """star: each pair is a phase; aron: two pairs of a three-wire system."""
    nominal_voltage: Positive | None = None
    """V between the metered conductors that are 100 %; without it, [metering] and [events] say it for all sources."""

    @property
    def makers(self) -> list[Callable[[StreamFormat], Stage | None]]:
        """Stages between the source and the meter."""
        return [self.correction.reordered, self.correction.of, self._wired]

    def _wired(self, form: StreamFormat) -> Aron | None:
        try:
            return Aron(form) if self.wiring == "aron" else None
        except ValueError as error:
            raise SettingError(f"source: {error}") from None


class DeviceSection(WaveformKeys):
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
        return spec_of(**self.model_dump(exclude=NOT_OF_THE_SOURCE))
