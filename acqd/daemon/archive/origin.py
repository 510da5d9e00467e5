"""What a daemon writes about its samples, and the meter that is made of it again."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from acqd import __version__
from acqd.archive.head import Metering, Origin
from acqd.daemon.boot import Boot
from acqd.daemon.device_section import WaveformKeys
from acqd.instruction_sets import best_instruction_set
from acqd.metering import Meter, Mode, StreamFormat
from acqd.metering.other_mains import meter_for
from acqd.metering.signal_watch import SignalWatch
from acqd.metering.stages import Stages

if TYPE_CHECKING:  # a process that makes rows again needs no configuration, which is slow to import
    from acqd.daemon.config import Config
    from acqd.daemon.source_sections import WaveformSection

_STAGES = ("correction", "wiring")
"""Keys of [source] that decide what happens between source and meter."""


def origin_of(config: Config, source: WaveformSection, form: StreamFormat, meter: Meter) -> Origin:
    """Of the samples of one box; `form` is that of the source."""
    how = config.metering
    metering = Metering(config.window, how.mode, how.nominal_voltage, meter.creep_W)
    stages = source.model_dump(mode="json", include=set(_STAGES))
    return Origin(config.device, form, source.kind, stages, metering, __version__, kernel_name(meter))


def kernel_name(meter: Meter) -> str:
    """What meters: rows are the same to the last bit by the same arithmetic only."""
    return f"c {best_instruction_set().name}" if meter.compiled else "numpy"


def state_of(stages: Stages, meter: Meter, boot: Boot) -> dict[str, Any]:
    """All that decides which rows the next block makes."""
    return {"stages": stages.state(), "meter": meter.state(), "boot": boot.state()}


@dataclass(frozen=True, slots=True)
class Again:
    """What makes rows of a segment as the daemon did."""

    stages: Stages
    meter: Meter
    boot: Boot

    @staticmethod
    def of(origin: Origin, state: dict[str, Any]) -> Again:
        """Raises ValueError for what no daemon has written."""
        how = origin.metering
        modes: dict[str, Mode] = {"synchronous": "synchronous", "fixed": "fixed"}
        if (mode := modes.get(how.mode)) is None:
            raise ValueError(f"its mode of metering is {how.mode!r}")
        stages = Stages(origin.form, [*WaveformKeys.model_validate(origin.stages).makers, SignalWatch])
        meter = meter_for(
            stages.form, window=how.window, mode=mode, nominal_voltage=how.nominal_voltage, creep_W=how.creep_W
        )  # fmt: skip
        try:
            stages.restore(state["stages"])
            meter.restore(state["meter"])
            return Again(stages, meter, Boot.of(state["boot"]))
        except (KeyError, TypeError) as error:
            raise ValueError(f"its state lacks {error}") from None
