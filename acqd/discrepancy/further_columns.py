"""What further columns of planned recordings would tell: the certificate with stand-ins for what robots could log."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

from acqd.arrays import Floats
from acqd.discrepancy.ability.ability import Ability
from acqd.discrepancy.ability.choices import Choice, choice
from acqd.discrepancy.regression.setup import Comparison, set_up
from acqd.discrepancy.selection.ranking import Rows
from acqd.discrepancy.selection.session_columns import with_sessions
from acqd.discrepancy.selection.spread import AS_IT_IS, More
from acqd.discrepancy.stand_ins import TOOL_S, TORQUE_ERROR, VOLTAGE_WANDERS, with_signals, with_torques
from acqd.models.effects import library
from acqd.report.digits import number, percent
from acqd.residual.logged_torque import Side

_MORE = (
    ("twice the minutes", 2.0, AS_IT_IS),
    ("as many minutes on another day", 2.0, More(days=2.0)),
    ("twice the unchanged recordings", 1.0, More(reference=2.0)),
)
"""In words; times the minutes; times the days and the sessions of the reference."""
_TORQUES: dict[Side, str] = {"link": "torques of joint sensors", "motor": "currents of motors"}
_TORQUE_ASSUMED = (
    f"an error of {percent(TORQUE_ERROR)} of a joint's greatest torque, with the memory of the residual; sizes are "
    "those of effects that torques show"
)
_SIGNALS = {
    "tool": ("the tool's signal", f"the tool switches every {number(TOOL_S)} s"),
    "brake": ("the brakes' signal", "the brakes close where the arm rests"),
    "Vrms": ("the mains voltage", f"the voltage wanders by {percent(VOLTAGE_WANDERS)}"),
}
"""By name: what people call the signal, and what is assumed of it."""
_LOGGED = ("temperature",)
"""What robots log beside torques and these signals."""
Progress = Callable[[str, float], None]


def further_choices(
    comparison: Comparison, rows: Rows, plan: Ability, longer: float, progress: Progress
) -> tuple[Choice, ...]:
    """The plan, twice its minutes, torques where none are logged, and the signals that are missing.

    `rows`: of the recordings to come beside the reference; `longer`: times the minutes of their motion.
    """
    return tuple(_choices(comparison, rows, plan, longer, progress))


def unread() -> tuple[str, ...]:
    """Columns that robots log and no effect of the library reads."""
    read = {name for effect in library().values() for name in effect.needs}
    return tuple(name for name in _LOGGED if name not in read)


def _open(rows: Rows) -> Floats:
    """[blocks] 1 for the recordings to come."""
    return rows.design.columns.in_question


def _choices(comparison: Comparison, rows: Rows, plan: Ability, longer: float, progress: Progress) -> Iterator[Choice]:
    known = library()
    has = [
        name for name, effect in known.items() if all(effect.possible(scene) for scene in rows.design.columns.scenes)
    ]
    yield choice("as planned", "", plan, plan, has)
    for name, times, more in _MORE:
        progress(f"judging {name}", 0.2)
        told = Ability.planned(rows, _open(rows), times * longer, doubled=False, more=more)
        yield choice(name, "", plan, told, has)
    if rows.design.witness is None:
        for side, name in _TORQUES.items():
            progress("adding torques of joints", 0.5)
            witness = with_torques(rows.design.columns, comparison.robot, side)
            if witness is not None:
                seeing = Rows(replace(rows.design, witness=witness), rows.regression, rows.learning_rate)
                told = Ability.planned(seeing, _open(seeing), longer, doubled=False)
                shown = [each for each in has if witness.sees(each)]
                yield choice(name, _TORQUE_ASSUMED, plan, told, has, shown)
    step_s = comparison.model.step_s
    asked, reference = (with_signals(each, step_s) for each in (comparison.in_question, comparison.reference))
    lacking = [name for name in _SIGNALS if any(name in known[each].needs for each in known if each not in has)]
    if lacking:
        setup = set_up(
            replace(comparison, in_question=asked, reference=reference),
            lambda share: progress("computing the columns of further signals", share),
        )
        all_signals = with_sessions(setup)
        with_all = Ability.planned(all_signals, _open(all_signals), longer, doubled=False)
        for name in lacking:
            reads = [each for each, effect in known.items() if set(effect.needs) == {name}]
            yield choice(*_SIGNALS[name], plan, with_all, [*has, *reads])
