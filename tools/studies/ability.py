"""Judges what `acqd robot ability` promises: effects of twice the smallest size are named, of half of it are not.

    python -m tools.studies.ability BUNDLE DS [--places 1] [--only payload] [--seed 7] [--json]

DS holds unchanged recordings of the robot of BUNDLE. For every effect that the certificate states a size for, the
power of the effect at a place that is drawn at random is added to the recordings, and the loop searches. The power is
that of the effect's own equation (simulated), so that the study judges the certificate and not the library. A third
size is that from which on the closest of the effects that can be told apart is told apart. Where DS has torques of
joints, those of the effect are added to them. `tools.studies.foreign.certificate` judges by effects with the equations
of foreign plants.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from acqd.discrepancy.ability.ability import Ability
from acqd.discrepancy.ability.pairs import Rival
from acqd.discrepancy.ability.smallest import Smallest
from acqd.discrepancy.config import CloseConfig
from acqd.discrepancy.joints.columns import effect_columns
from acqd.discrepancy.recordings import Subject, subject_of
from acqd.discrepancy.repair.naming import named_effects
from acqd.discrepancy.search import search
from acqd.models.effects import library
from acqd.models.effects.effect import effect_rows_at
from acqd.models.effects.scene import segment_scene
from acqd.models.segments import Segment
from tools.common.tables import show, verdict

FACTORS = (0.5, 2.0)
"""Times the smallest size."""
_APART = "apart"
"""Key of the effect that a case has to be told apart from."""


def options() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bundle", type=Path)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--places", type=int, default=1, help="places and shapes per effect (default 1)")
    parser.add_argument("--only", action="append", metavar="EFFECT", help="judge this effect; may be repeated")
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--json", action="store_true")
    return parser.parse_args()


def certificate(config: CloseConfig, subject: Subject) -> Ability:
    """What the loop says about unchanged recordings."""
    _, selection = search(config, subject, _silent)
    return Ability.of(selection.unexplained, selection.design.columns.in_question)


def drawn(ability: Ability, places: int, seed: int) -> Iterator[tuple[Smallest, float, Rival | None]]:
    """Places and shapes of every effect with a size, with times the smallest size, and the effect to be told apart."""
    rng = np.random.default_rng(seed)
    by_effect: dict[str, list[tuple[Smallest, tuple[Rival, ...]]]] = {}
    for place, rivals in ability.places:
        if place.size is not None:
            by_effect.setdefault(place.candidate.id, []).append((place, rivals))
    for known in by_effect.values():
        for number in rng.permutation(len(known))[:places]:
            place, rivals = known[number]
            for factor in FACTORS:
                yield place, factor, None
            closest = max((each for each in rivals if each.size is not None), key=_closeness, default=None)
            if closest is not None:
                assert closest.size is not None and place.size is not None
                yield place, closest.size / place.size, closest


def _closeness(rival: Rival) -> tuple[float, float]:
    return rival.size or 0.0, rival.explains


def case(
    config: CloseConfig, subject: Subject, place: Smallest, factor: float, rival: Rival | None = None
) -> dict[str, Any]:
    """The names that the loop gives where an effect has `factor` times its smallest size; `rival` is not among them."""
    assert place.size is not None and place.rms_W is not None
    add = partial(_with_effect, subject, place, factor * place.size, _remembered(subject, place))
    changed = replace(subject, fit=[add(s) for s in subject.fit], held_out=[add(s) for s in subject.held_out])
    delay, selection = search(config, changed, _silent)
    named = [each for each in named_effects(changed, selection, delay, _silent) if each.status == "named"]
    names = [[each.term.id, *(name for name, _ in each.family)] for each in named]
    right = any(place.candidate.id in each for each in names)
    if rival is not None:
        right = right and all(rival.id not in each for each in names)
    return {
        "effect": place.candidate.id, "where": place.candidate.label, "shape": dict(place.shape), "factor": factor,
        "size": factor * place.size, "rms_W": factor * place.rms_W, "limited_by": place.limited_by,
        _APART: rival.id if rival else None, "named": names, "right": right,
    }  # fmt: skip


def _remembered(subject: Subject, place: Smallest) -> dict[str, float]:
    """The start of the session, and what an effect takes from all of its recordings."""
    segments = [*subject.fit, *subject.held_out]
    fixed = library()[place.candidate.id].fixed_shape([segment_scene(subject.carrier, s) for s in segments])
    return {"origin_s": min(segment.start_s for segment in segments), **fixed}


def _with_effect(
    subject: Subject, place: Smallest, size: float, remembered: dict[str, float], segment: Segment
) -> Segment:
    candidate = place.candidate
    assert candidate.variant is not None
    scene = segment_scene(subject.carrier, segment)
    scene.memory.update(remembered)
    weights = candidate.weights(np.array([size]))
    columns, effect = candidate.variant.place.columns, library()[candidate.id]
    power = effect_rows_at(effect, scene, place.shape, columns, weights) @ weights
    changed = replace(segment, P=segment.P + power)
    if effect.acts_on != "torque":
        return changed
    torque = effect_columns(effect, scene, place.shape)[:, :, list(columns)] @ weights
    if segment.tau is not None and effect.at_link:
        changed = replace(changed, tau=segment.tau + torque)
    if "current" in segment.channels:
        constant = np.array([joint.drive.effort_per_ampere for joint in subject.robot.joint])
        current = segment.channels["current"] + torque / constant
        changed = replace(changed, channels={**segment.channels, "current": current})
    return changed


def _silent(_what: str, _share: float) -> None:
    """No progress of a single search."""


def main() -> None:
    """Print a line per case, and the shares."""
    given = options()
    with TemporaryDirectory() as folder:
        config = CloseConfig(given.dataset, given.bundle, Path(folder) / "loop")
        subject = subject_of(config, _silent)
        wanted = [
            each for each in drawn(certificate(config, subject), given.places, given.seed)
            if not given.only or each[0].candidate.id in given.only
        ]  # fmt: skip
        results = [case(config, subject, *each) for each in track(wanted, "effects", console=Console(stderr=True))]
    if given.json:
        print(json.dumps(results))
        return
    table = Table("effect", "where", "times", "size", "W RMS", "limited by", "apart from", "named", "right")
    for each in results:
        names = "; ".join(" or ".join(family) for family in each["named"])
        sizes = [f"{each[key]:.3g}" for key in ("factor", "size", "rms_W")]
        table.add_row(
            each["effect"],
            each["where"],
            *sizes,
            each["limited_by"],
            each[_APART] or "",
            names,
            verdict(each["right"], "yes", "no"),
        )
    show(table, width=180)
    for factor in FACTORS:
        right = [each["right"] for each in results if each["factor"] == factor and not each[_APART]]
        print(f"{factor:g} times the smallest size: {sum(right)} of {len(right)} named rightly")
    apart = [each["right"] for each in results if each[_APART]]
    print(f"at the size that tells the closest effect apart: {sum(apart)} of {len(apart)} named without that effect")


if __name__ == "__main__":
    main()
