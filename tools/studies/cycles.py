"""How exactly cycles are found in repeating motion, and that none are claimed in random motion (simulated motion).

    python -m tools.studies.cycles [--sessions 10] [--cycles 20] [--seed 0] [--json]

The laboratory's controller moves three robots. Sessions of pick cycles have part positions, speeds, blends and waiting
times that vary, some slow cycles, and interruptions; angles are sampled every 40 ms with the noise of encoders. The
cycle begins where the arm leaves its longest rest, which is at home or at a machine. A loop without rests has no
such moment, and any point of its path may be the first: boundaries are compared with the passes of the point that fits
best. Random motion visits random positions, or six stations in random order.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict, dataclass, field

import numpy as np
from rich.table import Table

from acqd.motion.chain import Move
from acqd.motion.controller import Controller, Phase, Step, Wait
from acqd.robot.description import RobotDescription, load_description
from acqd.work.cycles import cycles_of
from tools.common.tables import show

ROBOTS = ("iiwa7_r800", "ur10e", "kinova_gen3")
KINDS = ("wait at home", "wait at machine", "loop without rest")
RANDOM = ("random positions", "stations in random order")
STEP_S, RATE_HZ = 0.04, 1000
WITHIN_S = 0.08
NOISE_RAD = 2e-5
POINT_S = 0.05
"""Distance of the points of a loop's path that may be the first: less than WITHIN_S, so that it is no error."""
PASS_S = 0.01
"""Within which the pass of a point is known."""


@dataclass
class Score:
    """One line of the table."""

    robot: str
    motion: str
    sessions: int = 0
    true: int = 0
    """Boundaries of cycles; 0 in random motion."""
    hit: int = 0
    """Boundaries found within 80 ms."""
    claimed: int = 0
    """Boundaries found."""
    error_ms: list[float] = field(default_factory=list)

    @property
    def share(self) -> float | None:
        """Share of the true boundaries that were found."""
        return self.hit / self.true if self.true else None


@dataclass(frozen=True)
class Session:
    """Angles [T, axes] rad every 40 ms, and the true begins of cycles in s."""

    q: np.ndarray
    starts: list[np.ndarray]
    """One array; of a loop, one for each of many points of its path."""


def pick_cycles(robot: RobotDescription, kind: str, cycles: int, random: np.random.Generator) -> Session:
    """A session of `cycles` pick cycles."""
    home, pick, place = (_position(robot, random) for _ in range(3))
    above = [
        each + random.uniform(0.08, 0.2, robot.axes) * random.choice([-1, 1], robot.axes) for each in (pick, place)
    ]
    loop = kind == KINDS[2]
    interrupted = int(random.integers(2, cycles - 1))
    speed = random.uniform(0.3, 0.9)
    steps: list[Step] = [Wait(float(random.uniform(0.5, 3.0)))]
    for number in range(cycles):
        slow = speed * (0.6 if random.random() < 0.1 else 1.0)
        part = pick + random.normal(0, 0.006, robot.axes)
        path = [above[0], part, above[0], above[1], place, above[1], home]
        if not loop:  # a phase ends the motion before it
            steps.append(Phase(f"cycle {number}"))
        for place_number, target in enumerate(path):
            rest = 0.0 if loop else (0.3 if place_number in (1, 4) else 0.0)
            if kind == KINDS[1] and place_number == 1:
                rest = float(random.uniform(2.0, 6.0))
            if kind == KINDS[0] and target is home:
                rest = float(random.uniform(1.0, 5.0))
            if number == interrupted and target is home and not loop:
                rest += 20.0
            blend = 1.0 if rest or (number == cycles - 1 and target is home) else float(random.uniform(0.7, 0.95))
            steps.append(Move(target, slow * random.uniform(0.97, 1.03), 0.4, blend))
            if rest:
                steps += [Wait(rest), Phase(f"left {number} {place_number}")]
    motion = Controller(robot, home).run(steps)
    if loop:
        return Session(_sampled(motion.q, random), _loops(motion.q, home, cycles))
    return Session(_sampled(motion.q, random), [_starts(motion.phase, motion.phase_number, motion.q, kind)])


def random_motion(robot: RobotDescription, kind: str, seconds: float, random: np.random.Generator) -> Session:
    """Random positions, or six stations in random order, with rests and blends."""
    stations = [_position(robot, random) for _ in range(6)]
    steps: list[Step] = [Wait(1.0)]
    at = 0
    for _ in range(round(seconds / 3)):
        at = int(random.choice([k for k in range(6) if k != at]))
        target = _position(robot, random) if kind == RANDOM[0] else stations[at]
        rest = float(random.choice([0.0, random.uniform(0.3, 4.0)]))
        steps.append(Move(target, random.uniform(0.3, 0.9), 0.4, 1.0 if rest else random.uniform(0.6, 1.0)))
        if rest:
            steps.append(Wait(rest))
    return Session(_sampled(Controller(robot, stations[0]).run(steps).q, random), [np.zeros(0)])


def _position(robot: RobotDescription, random: np.random.Generator) -> np.ndarray:
    """A random position in the middle of the joints' ranges."""
    low, high = np.maximum(robot.lower, -1.5), np.minimum(robot.upper, 1.5)
    return np.asarray(random.uniform(low, high))


def _sampled(q: np.ndarray, random: np.random.Generator) -> np.ndarray:
    rows = q[:: round(STEP_S * RATE_HZ)]
    return np.asarray(rows + random.normal(0, NOISE_RAD, rows.shape))


def _starts(names: list[str], number: np.ndarray, q: np.ndarray, kind: str) -> np.ndarray:
    """Of each cycle, s: when the arm leaves the longest rest."""
    moving = np.flatnonzero(np.abs(np.diff(q, axis=0)).max(axis=1) > 0)
    ends = "left {} 1" if kind == KINDS[1] else "cycle {}"
    wanted = {name for n in range(len(names)) if (name := ends.format(n)) in names}
    at = [int(np.argmax(number == k)) for k, name in enumerate(names) if name in wanted]
    return np.array([moving[np.searchsorted(moving, each)] for each in at if each <= moving[-1]]) / RATE_HZ


def _loops(q: np.ndarray, home: np.ndarray, cycles: int) -> list[np.ndarray]:
    """When the arm passes each of many points of a cycle's path, once in every cycle, s."""
    rows = q[:: round(PASS_S * RATE_HZ)]
    first, last = (_passes(rows, home, cycles)[cycles // 2 :][:2] / PASS_S).round().astype(int).tolist()
    return [_passes(rows, point, cycles) for point in rows[first : last : round(POINT_S / PASS_S)]]


def _passes(q: np.ndarray, point: np.ndarray, cycles: int) -> np.ndarray:
    """When the arm passes a point, once in every cycle, s: the nearest rows (PASS_S), at least half a cycle apart."""
    distance = np.linalg.norm(q - point, axis=1)
    half = len(q) // (2 * cycles)
    at: list[int] = []
    for row in np.argsort(distance)[: len(q) // 4].tolist():
        if all(abs(row - other) > half for other in at):
            at.append(row)
        if len(at) == cycles:
            break
    return np.sort(np.array(at)) * PASS_S


def judge(score: Score, session: Session) -> None:
    """Compare what is found with the truth."""
    found = cycles_of(session.q, STEP_S).boundaries * STEP_S
    score.sessions += 1
    score.true += len(session.starts[0])
    score.claimed += len(found)
    if not len(session.starts[0]) or not len(found):
        return
    errors = [np.abs(starts[:, None] - found).min(axis=1) for starts in session.starts]
    error = max(errors, key=lambda each: int((each <= WITHIN_S).sum()))
    score.hit += int((error <= WITHIN_S).sum())
    score.error_ms += (1000 * error[error <= 1.0]).tolist()


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sessions", type=int, default=10, help="of every robot and motion (default 10)")
    parser.add_argument("--cycles", type=int, default=20, help="of a session (default 20)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", action="store_true")
    chosen = parser.parse_args()
    scores = [Score(robot, motion) for robot in ROBOTS for motion in (*KINDS, *RANDOM)]
    for number, score in enumerate(scores):
        robot = load_description(score.robot)
        for session in range(chosen.sessions):
            random = np.random.default_rng([chosen.seed, number, session])
            if score.motion in KINDS:
                judge(score, pick_cycles(robot, score.motion, chosen.cycles, random))
            else:
                judge(score, random_motion(robot, score.motion, 300.0, random))
    if chosen.json:
        print(json.dumps([asdict(each) for each in scores]))
        return
    table = Table("robot", "motion", "sessions", "boundaries", "within 80 ms", "share", "claimed", "median error")
    for each in scores:
        share = "" if each.share is None else f"{100 * each.share:.1f} %"
        median = f"{np.median(each.error_ms):.0f} ms" if each.error_ms else ""
        table.add_row(each.robot, each.motion, *map(str, (each.sessions, each.true, each.hit)), share,
                      str(each.claimed), median)  # fmt: skip
    show(table, width=120)


if __name__ == "__main__":
    main()
