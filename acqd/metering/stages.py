"""What happens to samples between the source and the meter: correction of channels, wiring."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

from acqd.metering.block import SampleBlock, StreamFormat


class Stage(Protocol):
    """One step."""

    form: StreamFormat
    """What the codes mean after the step."""

    def apply(self, block: SampleBlock) -> SampleBlock | None:
        """The next samples; None until there are some."""


class Stages:
    """Steps one after the other."""

    def __init__(self, form: StreamFormat, makers: Sequence[Callable[[StreamFormat], Stage | None]]) -> None:
        """Each maker gets the format that the step before it leaves; None: no such step."""
        self._stages: list[Stage] = []
        self.form = form
        for make in makers:
            stage = make(self.form)
            if stage is not None:
                self._stages.append(stage)
                self.form = stage.form

    def apply(self, block: SampleBlock) -> SampleBlock | None:
        """The next samples; None until there are some."""
        for stage in self._stages:
            ready = stage.apply(block)
            if ready is None:
                return None
            block = ready
        return block
