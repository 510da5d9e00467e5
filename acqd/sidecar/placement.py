"""Places one log in the metered power and compares it there with the model's prediction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from acqd.dataset.align import Lag
from acqd.dataset.placement import place
from acqd.dataset.power import PowerStream
from acqd.dataset.regressors import regressors_of
from acqd.errors import UserError
from acqd.models.predictor import Predictor
from acqd.report.digits import percent
from acqd.robot.description import RobotDescription
from acqd.sidecar.clock_memory import ClockMemory, PlacedLag
from acqd.sidecar.comparison import Comparison, compare
from acqd.sidecar.log_file import LogFile, span_of

_MARGIN_S = 5.0
_NOTEWORTHY_GAP = 0.05  # of a log's time


class Placer:
    """Places logs of one robot; the clock's memory is its state."""

    def __init__(self, robot: RobotDescription, model: Predictor, clock: ClockMemory, clocks_apart_s: float) -> None:
        self._robot, self._model, self._clock, self._clocks_apart_s = robot, model, clock, clocks_apart_s

    def place(self, log: LogFile, power: PowerStream) -> tuple[Comparison, PlacedLag]:
        """The log compared with its power at the lag of the clock line, or at its own lag. Raises UserError.

        The log is merged and predicted once, at the lag that the earlier logs let expect. The prediction refines the
        log's own lag, which for a long log is that of the piece with the most motion. It is then shifted to the final
        lag. The shift is small once the clock line is known.
        """
        regressors = regressors_of(log.moving, self._robot)
        search_s = self._clock.search_s(self._clocks_apart_s)
        near = self._power_near(log, power, search_s)
        placement = place([regressors], near, search_s, lambda _: None).placements[0]
        own, middle_s = placement.own, float(regressors.t[len(regressors.t) // 2])
        expected_s = self._clock.expected(middle_s, own)
        if expected_s is None:
            reason = placement.note or "no lag explains the power"
            raise UserError(f"{log.path.name}: {reason}{self._gap_note(log, power)}")
        comparison = compare(log, power, expected_s, self._model)
        lag = self._clock.place(middle_s, _refined(own, comparison))
        assert lag is not None  # what was enough for an expected lag is enough for a placement
        return comparison.at_lag(lag.seconds), lag

    def _power_near(self, log: LogFile, power: PowerStream, search_s: float) -> PowerStream:
        """The power around the piece that is placed: within hours, a repeated programme would be found elsewhere."""
        start_s, end_s = span_of(log.moving)
        far_s = max(self._clocks_apart_s, search_s) + _MARGIN_S
        rows = power.part(round((start_s - far_s) * 1e9), round((end_s + far_s) * 1e9))
        return replace(power, time_ns=power.time_ns[rows], P=power.P[rows], Vrms=power.Vrms[rows])

    def _gap_note(self, log: LogFile, power: PowerStream) -> str:
        """The share of the log without power, as a likely reason why it cannot be placed."""
        start_s, end_s = log.span_s
        t = power.time_ns[np.isfinite(power.P)] * 1e-9 + self._clock.last_lag_s
        seconds = np.count_nonzero((t >= start_s) & (t <= end_s)) * power.window_ns * 1e-9
        missing = 1 - seconds / max(end_s - start_s, 1e-9)
        return f"; power rows are missing for {percent(missing)} of the log" if missing > _NOTEWORTHY_GAP else ""


def _refined(own: Lag, comparison: Comparison) -> Lag:
    """A credible lag of the regression, corrected by the delay that the model's prediction shows at that lag."""
    if not own.credible:
        return own
    return replace(own, seconds=own.seconds - comparison.at_lag(own.seconds).delay_s())
