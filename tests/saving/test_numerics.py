"""Time laws, the division of time, and intervals of differences."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import approx_fprime

from acqd.cli.save import _longer
from acqd.errors import UserError
from acqd.models.greybox.model import GreyBox
from acqd.motion.chain import Move
from acqd.motion.controller import RATE, Wait
from acqd.motion.limits import greatest_jerk
from acqd.motion.program_file import Program
from acqd.robot.arm import Arm
from acqd.robot.collision import CollisionChecker
from acqd.robot.scene import load_scene
from acqd.saving.cycle import RELEASE_S, Rest, Stretch, joined, pieces_of
from acqd.saving.doubt import Doubt, _fitted
from acqd.saving.log_cycle import LogCycle
from acqd.saving.order import _exact, _exchanged, reordered
from acqd.saving.plan import Change, at_rest
from acqd.saving.posture import easier_rests, easier_waits
from acqd.saving.power import Meter
from acqd.saving.sharing import Curve, shared
from acqd.saving.time_law import Bounds, Path
from tests.builders import ROBOT, recording
from tests.saving.conftest import HOME


@pytest.fixture(scope="module")
def bounds():
    return Bounds(ROBOT, ROBOT.speed, ROBOT.acceleration, ROBOT.acceleration / 0.06)


@pytest.fixture(scope="module")
def motion(program):
    return program.motion(ROBOT)


@pytest.fixture(scope="module")
def path(motion, bounds, model):
    stretch = next(piece for piece in pieces_of(motion) if isinstance(piece, Stretch))
    return Path(stretch.motion, bounds, model)


def test_pieces_are_the_whole_motion_again(motion):
    pieces = pieces_of(motion)
    assert [type(piece) for piece in pieces] == [Rest, Stretch, Rest, Stretch, Rest]
    assert [piece.process for piece in pieces if isinstance(piece, Rest)] == [False, True, False]
    parts = [p.motion if isinstance(p, Stretch) else p.lasting(p.seconds, None) for p in pieces]
    assert np.abs(joined(parts).q - motion.q).max() < 1e-4


def test_a_law_keeps_the_path_the_ends_and_its_derivatives(path):
    law = 0.3 * np.sin(np.arange(path.size))
    seconds = 1.4 * path.motion.seconds
    new = path.motion_at(law, seconds)
    assert new.seconds == pytest.approx(seconds, abs=1e-3)
    assert np.allclose(new.q[[0, -1]], path.motion.q[[0, -1]], atol=1e-6)
    assert np.abs(np.diff(new.q, axis=0) * RATE - (new.qd[1:] + new.qd[:-1]) / 2).max() < 2e-3
    assert np.abs(np.diff(new.qd, axis=0) * RATE - (new.qdd[1:] + new.qdd[:-1]) / 2).max() < 2e-2
    assert greatest_jerk(new).max() < greatest_jerk(path.motion).max()


def test_the_best_law_uses_less_and_keeps_limits(path, model):
    meter = Meter(model, "")
    for factor in (0.9, 1.0, 1.5):
        seconds = factor * path.motion.seconds
        best = path.best(seconds, path.uniform)
        assert path.keeps_limits(best, seconds)
        saved = path.energy(path.uniform, seconds) - path.energy(best, seconds)
        assert saved > 0
        uses = [meter.use(path.motion_at(law, seconds)).energy for law in (path.uniform, best)]
        assert uses[0] - uses[1] == pytest.approx(saved, rel=0.15, abs=0.3)  # the model of rows agrees


def test_energy_has_the_slope_that_the_search_uses(path, monkeypatch):
    seen = {}

    def look(cost, start, **_):
        seen["value"], seen["slope"] = cost(start)
        seen["by differences"] = approx_fprime(start, lambda law: cost(law)[0], 1e-6)
        return type("Found", (), {"x": start})

    monkeypatch.setattr("acqd.saving.time_law.minimize", look)
    path.best(path.motion.seconds, 0.2 * np.cos(np.arange(path.size)))
    assert np.abs(seen["slope"] - seen["by differences"]).max() < 2e-3 * np.abs(seen["slope"]).max()


_SECONDS = st.integers(500, 9000).map(lambda milliseconds: milliseconds / 1000)  # apart by more than rounding
_CURVES = st.lists(
    st.lists(st.tuples(_SECONDS, st.floats(0, 50)), min_size=1, max_size=5, unique_by=lambda each: each[0]),
    min_size=1, max_size=4,
)  # fmt: skip


@settings(max_examples=30)
@given(_CURVES, st.floats(0, 1), st.integers(0, 2**31))
def test_no_other_division_of_the_time_uses_less(points, share, seed):
    curves = [Curve.hull(*np.array(each).T) for each in points]
    low, high = (np.array([curve.seconds[k] for curve in curves]) for k in (0, -1))
    total = float(low.sum() + share * (high - low).sum())
    best = np.array(shared(curves, total))
    assert best.sum() == pytest.approx(total)

    def energy(durations):
        return sum(np.interp(t, curve.seconds, curve.energy) for t, curve in zip(durations, curves, strict=True))

    random = np.random.default_rng(seed)
    for _ in range(5):  # from a random division in the box towards the total
        other = low + random.random(len(low)) * (high - low)
        room = (high - other) if other.sum() < total else (other - low)
        if room.sum() > 1e-9:
            other = other + np.sign(total - other.sum()) * room * min(abs(total - other.sum()) / room.sum(), 1.0)
        if other.sum() == pytest.approx(total):
            assert energy(best) <= energy(other) + 1e-6


def test_a_time_below_the_shortest_is_refused():
    with pytest.raises(UserError, match=r"2\.00 s cannot be reached: .* the shortest is 3\.00 s"):
        shared([Curve.hull(np.array([3.0, 4.0]), np.array([9.0, 5.0]))], 2.0)


@pytest.fixture(scope="module")
def held_out(model):
    """Recordings of a robot whose joints have 20 % more viscous friction than the model says."""
    values = model.values.copy()
    values[model.layout.part("viscous")] *= 1.2
    true = GreyBox(model.chain, model.layout, values, model.step_s, model.usual_signals())
    return true, [replace(recording(true, number), split="test") for number in range(6)]


def test_an_interval_holds_the_difference_that_a_wrong_friction_makes(model, held_out, path):
    true, segments = held_out
    doubt = Doubt.of(model, segments)
    meters = [Meter(each, "") for each in (model, true)]
    seconds = path.motion.seconds
    old, fast, slow = (path.motion_at(path.uniform, factor * seconds) for factor in (1.0, 0.85, 1.5))
    for new in (fast, slow):
        said, is_so = (meter.use(old).energy - meter.use(new).energy for meter in meters)
        half = doubt.half_width(meters[0].use(old), meters[0].use(new), 0.0)
        assert abs(said - is_so) < half < 0.4 * abs(is_so) + 10
    use = meters[0].use(old)
    assert doubt.half_width(use, use, 0.0) == 0
    assert Doubt.of(model, segments[:1]) is None
    assert Doubt.of(model, [replace(segment, split="train") for segment in segments]) is None


def test_the_wander_of_a_meter_is_no_error_of_a_difference(model, held_out, path):
    _, segments = held_out
    random = np.random.default_rng(3)  # otherwise nothing but the friction would be wrong
    noisy = [
        replace(each, P=each.P + np.repeat(random.normal(0, 0.5, len(each.P) // 50 + 1), 50)[: len(each.P)])
        for each in segments
    ]
    start = min(each.start_s for each in noisy)
    wandering = [
        replace(each, P=each.P + 2.0 + 0.02 * (each.start_s - start + model.step_s * np.arange(len(each.P))))
        for each in noisy
    ]
    before, after = (
        Meter(model, "").use(path.motion_at(path.uniform, share * path.motion.seconds)) for share in (1.0, 1.2)
    )
    still, moved = (Doubt.of(model, each).half_width(before, after, 10.0) for each in (noisy, wandering))
    assert moved == pytest.approx(still, rel=0.15)


def test_closed_brakes_end_an_error_and_rounding_makes_no_cycle_shorter():
    def rest(seconds, outer):
        rows = round(seconds * RATE)
        return Rest(HOME, seconds, np.ones(rows, bool), np.zeros(rows, bool), process=False, outer=outer)

    cycle = LogCycle([rest(1.0, True), rest(5.0, False), rest(1.0, True)], None, None, 0.5)
    as_it_is = [1.0, 5.0, 1.0]
    assert cycle.unlike_s(Change(brakes_after=2.0), as_it_is) == at_rest(5.0 - 2.0 - RELEASE_S)
    assert cycle.unlike_s(Change(), as_it_is) == 0.0
    motion, _ = cycle.timed(Change(waits=True), [1.0, 5.0004, 1.0])
    assert len(motion) == 7000 and len(cycle.timed(Change(waits=True), [1.0004, 5.0004, 1.0004])[0]) == 7001


def test_a_long_wait_with_a_stretched_arm_moves_to_where_holding_is_easier(model, bounds):
    stretched = np.radians([0.0, -20.0, 20.0, -90.0, -90.0, 0.0])
    steps = (Wait(0.5), Move(stretched, 0.4, 0.3), Wait(8.0), Move(HOME, 0.2, 0.3), Wait(0.5))
    program, meter = Program(HOME, steps), Meter(model, "")
    motion = program.motion(ROBOT)
    moved = easier_rests(pieces_of(motion), meter, bounds, 0.5)
    whole = joined([each.motion if isinstance(each, Stretch) else each.lasting(each.seconds, None) for each in moved])
    other = easier_waits(program, ROBOT, meter, 0.5).motion(ROBOT)
    for new in (whole, other):
        assert new.seconds == pytest.approx(motion.seconds, abs=0.01)
        assert meter.use(new).energy < meter.use(motion).energy - 5
        assert np.abs(np.diff(new.q, axis=0)).max() * RATE < 1.05 * np.abs(motion.qd).max()
        assert (greatest_jerk(new) <= ROBOT.acceleration / 0.06).all()
        far = np.abs(new.q[::50, None] - motion.q[None, ::20]).max(axis=2).min(axis=1)
        assert far.max() < 0.02  # along the path
    assert easier_rests(pieces_of(Program(HOME, steps[::2]).motion(ROBOT)), meter, bounds, 0.5) is None


def test_stopping_at_an_easier_posture_keeps_the_limits_of_the_joints(model, bounds):
    """A stop within a second of a fast motion asks for more than the motion itself."""
    stretched = np.radians([0.0, -20.0, 20.0, -90.0, -90.0, 0.0])
    motion = Program(HOME, (Wait(0.5), Move(stretched, 0.4, 0.3), Wait(8.0), Move(HOME, 0.7, 0.1), Wait(0.5))).motion(
        ROBOT
    )
    meter = Meter(model, "")
    stretch = [each for each in pieces_of(motion) if isinstance(each, Stretch)][-1].motion
    most = np.abs(stretch.qdd).max(axis=0)
    tight = replace(bounds, acceleration=most)
    moved = easier_rests(pieces_of(motion), meter, tight, 0.5)
    for each in [each.motion for each in moved or [] if isinstance(each, Stretch)][-2:]:
        assert (np.abs(each.qdd).max(axis=0) <= 1.001 * most).all()
    moved = easier_rests(pieces_of(motion), meter, bounds, 0.5)
    stopping, starting = [each.motion for each in moved if isinstance(each, Stretch)][-2:]
    for each in (stopping, starting):  # no step of the position that the speeds do not say
        assert np.abs(np.diff(each.q, axis=0) * RATE - (each.qd[1:] + each.qd[:-1]) / 2).max() < 0.01


def test_time_that_no_piece_can_take_is_refused():
    """A program with its waits as they are cannot last for ever, and seconds are not dropped without a word."""
    curves = [
        Curve(np.array([2.0, 5.0]), np.array([9.0, 4.0]), np.arange(2)),
        Curve(np.array([1.0]), np.zeros(1), np.zeros(1, int)),
    ]
    assert sum(shared(curves, 5.5)) == pytest.approx(5.5)
    with pytest.raises(UserError, match=r"8\.00 s cannot be reached: the longest is 7\.00 s"):
        shared(curves, 7.0, 1.0)


@pytest.mark.parametrize("text", ["infs", "nan%", "10%s", "1e6s", "300%", "0s", ""])
def test_a_longer_cycle_is_percent_or_seconds(text):
    with pytest.raises(UserError, match="expected percent up to 200"):
        _longer(text)


def test_points_in_a_bad_order_are_visited_on_the_shortest_round(model):
    """Turns of the first joint by 10, 50, 20, 40, 30 degrees and home: upwards, or downwards, is the best round."""
    points = [HOME + np.radians([turn, 0, 0, 0, 0, 0]) for turn in (10, 50, 20, 40, 30)]
    steps = [step for point in points for step in (Move(point, 0.3, 0.3, 0.6), Wait(0.2 + point[0]))]
    program = Program(HOME, (Wait(0.3), *steps, Move(HOME, 0.3, 0.3)))
    checker = CollisionChecker(Arm(ROBOT), load_scene("free"))
    again = reordered(program, ROBOT, checker, Meter(model, ""))
    moves = [step for step in again.steps if isinstance(step, Move)]
    turns = np.degrees([move.target[0] for move in moves])
    ways = np.abs(np.diff([0.0, *turns]))
    assert ways.sum() == pytest.approx(100) and turns[-1] == 0
    for k, step in enumerate(again.steps[:-1]):  # every point keeps its wait
        if isinstance(step, Move):
            assert again.steps[k + 1].seconds == pytest.approx(0.2 + step.target[0])
    cost = np.abs(np.subtract.outer([0.0, 10, 50, 20, 40, 30, 0], [0.0, 10, 50, 20, 40, 30, 0]))
    for found in (_exact(cost), _exchanged(cost)):
        assert cost[[0, *found[:-1]], found].sum() == 100
    assert reordered(again, ROBOT, checker, Meter(model, "")) is None


def test_the_levels_of_sessions_are_free_and_a_day_of_blocks_needs_little_memory():
    rng = np.random.default_rng(3)
    session = np.repeat(np.arange(40), 400)
    power, noise = rng.normal(size=(len(session), 2)), rng.normal(size=len(session))
    tracemalloc.start()
    factors, variance = _fitted(power, 0.2 * power[:, 0] + noise + 10.0 * session, session)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert np.sqrt(factors[0, 0]) == pytest.approx(0.2, abs=0.04) and variance == pytest.approx(1.0, abs=0.05)
    assert most < 100 * power.nbytes
