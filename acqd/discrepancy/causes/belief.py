"""Probabilities of the causes of a residual, calibrated on simulated plants, and a conformal set of them (ADR 65).

A label is an effect of the library, something outside of the library, or nothing. Differences of evidence to the
strongest rival, over what chance and wrong columns may move between the two, are logits of the hypotheses; their scale
was fitted once (`calibration.json`; Platt 1999, here for many classes). Whether anything has changed is a question of
its own: its logit follows what unchanged sessions leave of the evidence of the best hypothesis.

The set holds every label whose likelihood reaches a threshold of its class. With the k-th smallest likelihood that the
true label of n calibration cases of its class had, k = floor(0.05 (n + 1)), the set misses the label of one more
case of that class with a probability of at most 5 % (class-conditional split conformal prediction: Vovk, Lindsay,
Nouretdinov and Gammerman 2003; these sets are the smallest on average: Sadinle, Lei and Wasserman 2019). The theorem
asks that the case is exchangeable with those of the calibration: plants of another kind may be missed more often.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np
import orjson
from scipy.special import expit

from acqd.arrays import Floats
from acqd.discrepancy.selection.standing import LAW, Standing
from acqd.models.effects import library

OUTSIDE, NOTHING = "outside the library", "nothing"
CLASSES = ("effect", OUTSIDE, NOTHING)
MISSED = 0.05
"""Share of cases whose cause a set may miss."""


@dataclass(frozen=True, slots=True)
class Scale:
    """From evidence to probabilities."""

    chance: float
    """Evidence per logit that chance may move between two hypotheses; 2 where the likelihood could be believed."""
    columns: float
    """Share of what wrong columns could move at most that counts per logit, too."""
    outside: tuple[float, float]
    """Logit of the best law that is level with its strongest rival, and a factor of the distance between the two."""
    nothing: tuple[float, float]
    """Logit of nothing where no hypothesis has evidence, and what it falls by per unit of log(1 + evidence)."""
    misled: float
    """Share of cases whose evidence says nothing of the cause: shared by all labels alike."""

    def likelihoods(self, standing: Standing) -> dict[str, float]:
        """Shares of all labels if the evidence never misled: what orders them; they sum to 1."""
        behind = standing.behind(self.chance, self.columns)
        # an effect that does not act, or that was searched for in vain, has no evidence
        logits = dict.fromkeys(library(), -max(standing.evidence.values(), default=0.0) / self.chance)
        logits |= {name: -each for name, each in behind.items() if name != LAW}
        if LAW in behind:
            logits[OUTSIDE] = self.outside[0] - self.outside[1] * behind[LAW]
        values = np.array(list(logits.values()))
        shares = np.exp(values - values.max())
        evidence = np.log1p(max(standing.above_nothing, 0.0))
        nothing = float(expit(self.nothing[0] - self.nothing[1] * evidence))
        shares *= (1 - nothing) / shares.sum()
        found = dict(zip(logits, shares.tolist(), strict=True)) | {NOTHING: nothing}
        for name, (other, share) in standing.twins.items():
            found[other] += share * found[name]
            found[name] *= 1 - share
        return found

    def probabilities(self, standing: Standing) -> dict[str, float]:
        """Of every label, the likeliest first; they sum to 1."""
        found = self.likelihoods(standing)
        shared = self.misled / len(found)
        return {
            label: (1 - self.misled) * share + shared
            for label, share in sorted(found.items(), key=lambda pair: -pair[1])
        }


@dataclass(frozen=True, slots=True)
class Calibration:
    """A scale, and the least likelihood of a member of the set, by class."""

    scale: Scale
    least: Mapping[str, float]
    cases: Mapping[str, int]
    """Calibration cases by class."""
    source: str
    """What they were, and the command that made them."""

    @classmethod
    def of(cls, scale: Scale, cases: Iterable[tuple[Standing, frozenset[str]]], source: str) -> Calibration:
        """`cases`: standings, and the labels that are true (several, where names mean the same)."""
        reached: dict[str, list[float]] = {name: [] for name in CLASSES}
        for standing, true in cases:
            shares = scale.likelihoods(standing)
            best = max(true, key=lambda label: shares.get(label, 0.0))
            reached[class_of(best)].append(shares.get(best, 0.0))
        least = {name: _threshold(np.array(values)) for name, values in reached.items()}
        return cls(scale, least, {name: len(values) for name, values in reached.items()}, source)

    def believed(self, standing: Standing) -> Belief:
        """Probabilities and set."""
        shares, likely = self.scale.probabilities(standing), self.scale.likelihoods(standing)
        members = [label for label in shares if likely[label] >= self.least[class_of(label)]]
        return Belief(shares, tuple(members) or tuple(shares)[:1])

    def as_json(self) -> dict[str, Any]:
        """For the file that `shipped` reads."""
        return {
            "scale": asdict(self.scale),
            "least": dict(self.least), "cases": dict(self.cases), "source": self.source,
        }  # fmt: skip

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> Calibration:
        """The inverse of `as_json`."""
        scale: dict[str, Any] = dict(content["scale"])
        outside, nothing = tuple(scale.pop("outside")), tuple(scale.pop("nothing"))
        return cls(
            Scale(outside=outside, nothing=nothing, **scale), content["least"], content["cases"], content["source"]
        )


@dataclass(frozen=True, slots=True)
class Belief:
    """What may be the cause."""

    probabilities: Mapping[str, float]
    """By label, the likeliest first; they sum to 1."""
    members: tuple[str, ...]
    """Labels of the set, the likeliest first."""


def given_lead(belief: Belief, name: str, confidence: float, rivals: Mapping[str, float]) -> Belief:
    """The belief where effects were selected: `confidence` in the largest, and in its `rivals` by label.

    These were judged beside everything that was selected later, the belief before anything was selected: it shares what
    is left. The set is the smallest that has 95 %.
    """
    free, of_rivals = 1 - confidence, sum(rivals.values())
    scale = min(1.0, free / of_rivals) if of_rivals > 0 else 0.0
    shares = {name: confidence} | {label: scale * share for label, share in rivals.items()}
    others = {label: share for label, share in belief.probabilities.items() if label not in shares}
    left = (1 - sum(shares.values())) / max(sum(others.values()), 1e-12)
    shares |= {label: left * share for label, share in others.items()}
    shares = dict(sorted(shares.items(), key=lambda pair: -pair[1]))
    enough = int(np.searchsorted(np.cumsum(list(shares.values())), 1 - MISSED)) + 1
    return Belief(shares, tuple(shares)[:enough])


def with_member(belief: Belief, label: str) -> Belief:
    """The same probabilities; the set holds the label."""
    members = {*belief.members, label}
    return replace(belief, members=tuple(each for each in belief.probabilities if each in members))


def class_of(label: str) -> str:
    """One of CLASSES."""
    return label if label in (OUTSIDE, NOTHING) else "effect"


@cache
def shipped() -> Calibration:
    """The calibration that acqd uses."""
    return Calibration.from_json(orjson.loads(files(__package__).joinpath("calibration.json").read_bytes()))


def _threshold(reached: Floats) -> float:
    """The k-th smallest value, k = floor(MISSED (n + 1)); 0 where there are too few to leave any out."""
    rank = int(MISSED * (len(reached) + 1))
    return float(np.sort(reached)[rank - 1]) if rank else 0.0
