"""Keys that many kinds of `[source]` share."""

from __future__ import annotations

from acqd.daemon.correction_section import CorrectionSection
from acqd.daemon.section import Nominal, Positive, Section
from acqd.sources.spec import Spec, spec_of

NOT_OF_THE_SOURCE = {"correction"}
"""Keys that concern the samples after MAIN_FAST."""


class WaveformKeys(Section):
    """Keys of everything that delivers samples."""

    correction: CorrectionSection = CorrectionSection()


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
