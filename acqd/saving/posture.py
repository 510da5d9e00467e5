"""Long waits at a posture that holds more easily: a place on the way to the next point, where the arm stops instead.

The path does not change, so that nothing new can be in the way. Stopping and starting again take time from the wait,
and are kept within the limits of the joints.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from acqd.arrays import Floats
from acqd.motion.chain import Move
from acqd.motion.controller import RATE, Motion, Step, Wait
from acqd.motion.program_file import Program
from acqd.robot.description import RobotDescription
from acqd.saving.cycle import Rest, Stretch
from acqd.saving.power import Meter
from acqd.saving.time_law import Bounds

LONG_S = 3.0
"""A shorter wait is not worth a stop."""
_LEAST_W = 1.0
"""Of holding power that a posture has to save."""
_RAMP_S = 0.6
"""Of the old time, over which the arm stops, and starts again; both take twice as long."""
_PLACES = 41


def easier_rests(
    pieces: Sequence[Rest | Stretch], meter: Meter, bounds: Bounds, least_rest: float
) -> list[Rest | Stretch] | None:
    """The pieces of a log with long waits moved along the path; None where no place holds more easily."""
    out: list[Rest | Stretch] = []
    waiting: tuple[Rest, Rest, int] | None = None
    moved = False
    for number, piece in enumerate(pieces):
        after = pieces[number + 1] if number + 1 < len(pieces) else None
        if isinstance(piece, Stretch) and waiting is not None:
            stay, wait, row = waiting
            out += [stay, _stopping(piece, row), wait, _starting(piece, row)]
            waiting, moved = None, True
        elif isinstance(piece, Rest) and isinstance(after, Stretch) and not after.fixed:
            waiting = _moved_wait(piece, after, meter, bounds, least_rest)
            if waiting is None:
                out.append(piece)
        else:
            out.append(piece)
    return out if moved else None


def _moved_wait(
    rest: Rest, after: Stretch, meter: Meter, bounds: Bounds, least_rest: float
) -> tuple[Rest, Rest, int] | None:
    """What stays of a wait, the wait elsewhere, and the row of the next stretch at which that is."""
    left_s = rest.seconds - least_rest - 2 * _RAMP_S
    margin = round(_RAMP_S * RATE)
    if not rest.free or left_s < LONG_S or not rest.brake_open.all() or len(after.motion) < 3 * margin:
        return None
    rows = np.linspace(margin, len(after.motion) - margin, _PLACES).astype(int)
    power = meter.holding(after.motion.q[rows])
    easier = power <= float(meter.holding(rest.position[None])[0]) - _LEAST_W
    most = bounds.widest(after.motion)
    row = next(
        (
            row
            for row in rows[power.argsort()].tolist()
            if row in rows[easier]
            and all(bounds.keeps(each.motion, most) for each in (_stopping(after, row), _starting(after, row)))
        ),
        None,
    )
    if row is None:
        return None
    stay, wait = round(least_rest * RATE), round(left_s * RATE)
    return (
        replace(rest, seconds=stay / RATE, brake_open=rest.brake_open[:stay], tool_on=rest.tool_on[:stay]),
        replace(
            rest, position=after.motion.q[row], seconds=wait / RATE, brake_open=rest.brake_open[:wait],
            tool_on=rest.tool_on[:wait],
        ),
        row,
    )  # fmt: skip


def _stopping(stretch: Stretch, row: int) -> Stretch:
    """The stretch up to a row, where it stops."""
    ramp = round(_RAMP_S * RATE)
    tau = np.arange(2 * ramp + 1) / RATE
    pace, place, change = _ramp(tau)
    u = np.concatenate([np.arange(row - ramp), row - ramp + place * RATE])
    flat = np.zeros(row - ramp)
    return Stretch(
        _along(stretch.motion, u, np.concatenate([flat + 1, pace]), np.concatenate([flat, change])), fixed=False
    )


def _starting(stretch: Stretch, row: int) -> Stretch:
    """The stretch from a row on, where it starts; the row itself is the last one before the wait."""
    ramp, rows = round(_RAMP_S * RATE), len(stretch.motion)
    tau = np.arange(1, 2 * ramp)[::-1] / RATE
    pace, place, change = _ramp(tau)
    rest = np.arange(row + ramp, rows)
    u = np.concatenate([row + ramp - place * RATE, rest])
    flat = np.zeros(len(rest))
    return Stretch(
        _along(stretch.motion, u, np.concatenate([pace, flat + 1]), np.concatenate([-change, flat])), fixed=False
    )


def _ramp(tau: Floats) -> tuple[Floats, Floats, Floats]:
    """Pace from 1 to 0 over twice the ramp, the old time that has passed (s), and the derivative of the pace."""
    turn = np.pi / (2 * _RAMP_S)
    pace = 0.5 * (1 + np.cos(turn * tau))
    return pace, 0.5 * (tau + np.sin(turn * tau) / turn), -0.5 * turn * np.sin(turn * tau)


def _along(motion: Motion, u: Floats, pace: Floats, change: Floats) -> Motion:
    """The motion at rows `u` of the old time, which passes with `pace`; `change` is the derivative of the pace, 1/s."""
    low = np.clip(u.astype(int), 0, len(motion) - 1)
    high, part = np.minimum(low + 1, len(motion) - 1), (u - low)[:, None]

    def there(values: Floats) -> Floats:
        return np.asarray(values[low] + part * (values[high] - values[low]))

    qd, qdd = there(motion.qd), there(motion.qdd)
    return replace(
        motion, q=there(motion.q), qd=qd * pace[:, None], qdd=qdd * pace[:, None] ** 2 + qd * change[:, None],
        brake_open=np.ones(len(u), bool), tool_on=motion.tool_on[low], phase=[""],
        phase_number=np.zeros(len(u), np.int16),
    )  # fmt: skip


def easier_waits(program: Program, robot: RobotDescription, meter: Meter, least_rest: float) -> Program | None:
    """The program with long waits moved to a place on the next motion; None where no place holds more easily."""
    steps = list(program.steps)
    at, moved = program.start, False
    out: list[Step] = []
    for number, step in enumerate(steps):
        following = next((each for each in steps[number + 1 :] if isinstance(each, Move)), None)
        begun = any(isinstance(each, Move) for each in steps[:number])
        if isinstance(step, Move):
            at = step.target
        if not isinstance(step, Wait) or following is None or not begun or step.seconds < least_rest + LONG_S:
            out.append(step)
            continue
        shares = np.linspace(0.0, 1.0, _PLACES)[1:-1]
        places = at + shares[:, None] * (following.target - at)
        power = meter.holding(places)
        if float(meter.holding(at[None])[0]) - float(power.min()) < _LEAST_W:
            out.append(step)
            continue
        place = places[int(power.argmin())]
        out += [Wait(least_rest), replace(following, target=place, blend_after=1.0), Wait(step.seconds - least_rest)]
        moved = True
    if not moved:
        return None
    longer = Program(program.start, tuple(out)).motion(robot).seconds - program.motion(robot).seconds
    waits = [k for k, step in enumerate(out) if isinstance(step, Wait) and step not in steps and step.seconds > longer]
    if not waits:
        return None
    number = max(waits, key=lambda k: out[k].seconds)  # type: ignore[union-attr]
    out[number] = Wait(out[number].seconds - longer)  # type: ignore[union-attr]
    return Program(program.start, tuple(out))
