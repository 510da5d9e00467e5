"""What happens to samples between the source and the meter: correction of channels, wiring."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Protocol

from acqd.metering.block import SampleBlock, StreamFormat
from acqd.metering.packed import State
from acqd.metering.run import Run
from acqd.metering.signal_watch import SignalWatch


class Stage(Protocol):
    """One step."""

    form: StreamFormat
    """What the codes mean after the step."""

    def apply(self, block: SampleBlock) -> SampleBlock | None:
        """The next samples; None until there are some."""

    def state(self) -> State:
        """What the step must know of the stream so far."""

    def restore(self, state: State) -> None:
        """Go on where `state` was taken."""


class Stages:
    """Steps one after the other."""

    def __init__(self, form: StreamFormat, makers: Sequence[Callable[[StreamFormat], Stage | None]]) -> None:
        """Each maker gets the format that the step before it leaves; None: no such step."""
        self._stages: list[Stage] = []
        self._rate = form.rate
        self.form = form
        for make in makers:
            stage = make(self.form)
            if stage is not None:
                self._stages.append(stage)
                self.form = stage.form

    def state(self) -> list[State]:
        """What the steps know of the stream so far."""
        return [stage.state() for stage in self._stages]

    def restore(self, states: Sequence[State]) -> None:
        """Go on where `states` were taken. Raises ValueError for those of other steps."""
        try:
            for stage, state in zip(self._stages, states, strict=True):
                stage.restore(state)
        except (KeyError, TypeError) as error:
            raise ValueError(f"no state of a correction: {error!r}") from None

    def apply(self, block: SampleBlock) -> SampleBlock | None:
        """The next samples; None until there are some."""
        for stage in self._stages:
            ready = stage.apply(block)
            if ready is None:
                return None
            block = ready
        return block

    def apply_run(self, run: Run) -> Iterator[SampleBlock]:
        """What `apply` makes of each block of a run, in blocks as long as can be: none is cut, some are joined."""
        if len(self._stages) == 1 and isinstance(self._stages[0], SignalWatch):
            yield from self._stages[0].apply_run(run)
            return
        for block in run.blocks(self._rate):
            if (ready := self.apply(block)) is not None:
                yield ready
