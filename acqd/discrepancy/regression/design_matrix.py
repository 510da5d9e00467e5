"""All columns of all recordings, white, and who owns which of them."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.discrepancy.regression.gram import Blocks
from acqd.discrepancy.regression.grey_box_columns import base_columns
from acqd.discrepancy.regression.smooth_alternatives import Ranges, generic_columns, rivals
from acqd.discrepancy.residual.whitening import ORDER, Whitener
from acqd.models.effects import library
from acqd.models.effects.effect import effect_rows
from acqd.models.effects.places import Variant
from acqd.models.effects.scene import Scene, scene_of
from acqd.models.effects.substeps import RADIUS, Lag, averaged
from acqd.models.greybox.model import GreyBox
from acqd.models.segments import Segment
from acqd.numerics import mad_sigma
from acqd.robot.arm import Arm

_LONGEST_ROWS = 1500  # of a block: a minute
LEAST_ROWS = 4 * ORDER
_OUTLIER = 6.0  # spreads of the white residual


@dataclass(frozen=True, slots=True)
class Candidate:
    """One hypothesis: an effect in one shape at one place, or an unnamed rival."""

    id: str
    """Of the effect; "" for a rival."""
    label: str
    """Where, or what a rival depends on."""
    places: NDArray[np.int64]
    """Raw columns."""
    variant: Variant | None
    detected: bool = False
    """Whether its columns were found by looking at the residual."""
    cost: float = 0.0
    """Parameters spent on that search."""

    @property
    def size(self) -> int:
        """Free coefficients."""
        return self.variant.size if self.variant else len(self.places)

    @property
    def mix(self) -> Floats | None:
        """[columns, coefficients]."""
        return self.variant.place.mix if self.variant else None


@dataclass(slots=True)
class Part:
    """One block of rows."""

    recording: str
    in_question: bool
    """Of the dataset in question (else of the reference)."""
    start_s: float
    segment: int
    rows: slice
    """Of its stretch; the first ORDER are lost to whitening."""


@dataclass(slots=True)
class Design:
    """What competitions are made from."""

    model: GreyBox
    base: int
    """Columns of the base model, the first."""
    candidates: list[Candidate]
    parts: list[Part]
    segments: list[Segment]
    scenes: list[Scene]
    raw: list[NDArray[np.float32]]
    """Per stretch [T, p]."""
    residual: list[Floats]
    """Per stretch [T] W: measured minus predicted by the base model."""
    whitener: Whitener
    patient: Whitener = field(default_factory=lambda: Whitener(np.ones(1)))
    """The same noise with a longer memory: what switches every minute shows only there."""
    white: list[NDArray[np.float32]] = field(default_factory=list)
    """Per part [rows, p + 1]."""
    trusted: list[NDArray[np.bool_]] = field(default_factory=list)
    """Per part [rows]: whether a white row is no outlier."""
    chosen: set[str] = field(default_factory=set)
    """Effects that compete."""
    blocks: Blocks = field(default_factory=lambda: Blocks(np.empty((0, 1, 1)), np.empty(0), np.empty((0, 1, 1))))

    @property
    def dynamic_range(self) -> float:
        """Of the measured power: p99 - p1 [W]."""
        return float(np.ptp(np.percentile(np.concatenate([s.P for s in self.segments]), [1, 99])))

    @property
    def in_question(self) -> Floats:
        """[blocks] 1 for the dataset in question."""
        return np.array([part.in_question for part in self.parts]) * 1.0


def make_design(
    model: GreyBox,
    arm: Arm,
    segments: list[tuple[Segment, bool]],
    chosen: set[str],
    withheld: frozenset[str],
    progress: Callable[[float], None],
) -> Design:
    """`stretches` with whether they are in question; `chosen` effects compete, and all rivals."""
    only = [segment for segment, _ in segments]
    scenes = [scene_of(model, s.q, s.signals, s.start_s, s.channels) for s in only]
    _tell_time(scenes, [in_question for _, in_question in segments])
    ranges = Ranges.of(scenes)
    effects = [e for name, e in library().items() if name in chosen and all(e.possible(scene) for scene in scenes)]
    raw: list[NDArray[np.float32]] = []
    for number, scene in enumerate(scenes):
        lag = Lag(float(model.group("lag")[0]), scene.step_s)
        columns = [base_columns(arm, scene, withheld), *(effect_rows(effect, scene) for effect in effects)]
        columns.append(averaged(lag.run(generic_columns(scene, ranges))))
        raw.append(np.concatenate(columns, axis=1).astype(np.float32))
        progress((number + 1) / len(scenes))
    candidates: list[Candidate] = []
    place = model.layout.size
    for effect in effects:
        candidates += [
            Candidate(effect.id, variant.place.where, place + np.array(variant.columns), variant)
            for variant in effect.variants(scenes[0])
        ]
        place += effect_rows(effect, scenes[0]).shape[1]
    candidates += [Candidate("", r.name, place + np.array(r.columns), None) for r in rivals(model.axes)]
    off = [s.P - scene.predicted for s, scene in zip(only, scenes, strict=True)]
    parts = _parts(segments, model.step_s)
    none = Whitener(np.ones(1))
    return Design(model, model.layout.size, candidates, parts, only, scenes, raw, off, none, chosen=chosen)


def _tell_time(scenes: list[Scene], in_question: list[bool]) -> None:
    """Effects that remember when the session began are told."""
    for kind in (True, False):
        origin = min((float(s.t[0]) for s, f in zip(scenes, in_question, strict=True) if f == kind), default=0.0)
        for scene, own in zip(scenes, in_question, strict=True):
            if own == kind:
                scene.memory["origin_s"] = origin


def _parts(segments: list[tuple[Segment, bool]], step_s: float) -> list[Part]:
    found = []
    for number, (segment, in_question) in enumerate(segments):
        rows = len(segment.P)
        count = max(1, round(rows / _LONGEST_ROWS))
        edges = np.linspace(0, rows, count + 1).astype(int)
        for first, last in itertools.pairwise(edges):
            first = max(0, int(first) - ORDER)  # rows lost to whitening come from the block before
            if last - first >= LEAST_ROWS:
                found.append(
                    Part(
                        segment.recording,
                        in_question,
                        segment.start_s + first * step_s,
                        number,
                        slice(first, int(last)),
                    )
                )
    return found


def whiten(design: Design, whitener: Whitener) -> None:
    """All columns and residuals of all parts by one noise model, and their Gram matrices.

    All rows of known motion are trusted.
    """
    design.whitener, design.white, design.trusted = whitener, [], []
    for part in design.parts:
        design.white.append(whitener.apply(_both(design, part)))
        design.trusted.append(_known_motion(design, part))
    sum_up(design)


def distrust(design: Design, fits: list[Floats]) -> float:
    """Leave rows out that stand off even a fit of everything ([p] coefficients per part); the share left out.

    A protective stop or a collision says nothing about any effect, and a few such rows outweigh hours.
    """
    off = [white[:, -1] - white[:, :-1] @ beta for white, beta in zip(design.white, fits, strict=True)]
    spread = mad_sigma(np.concatenate(off), 0.0) + 1e-9
    near = [np.abs(each) < _OUTLIER * spread for each in off]
    design.trusted = [near_ & known for near_, known in zip(near, design.trusted, strict=True)]
    sum_up(design)
    return 1 - float(np.concatenate(design.trusted).mean())


def _known_motion(design: Design, part: Part) -> NDArray[np.bool_]:
    """[rows] of a part: False for the last of a stretch, whose motion goes on where nobody logged it."""
    last = len(design.residual[part.segment]) - RADIUS
    return np.arange(part.rows.start + ORDER, part.rows.stop) < last


def _both(design: Design, part: Part) -> NDArray[np.float32]:
    """[rows, p + 1] columns and residual of a part, not white."""
    off = design.residual[part.segment][part.rows, None]
    return np.concatenate([design.raw[part.segment][part.rows], off.astype(np.float32)], axis=1)


def sum_up(design: Design) -> None:
    """Gram matrices of trusted rows, anew."""
    grams: list[Floats] = []
    plain: list[Floats] = []
    rows = []
    for part, white, trusted in zip(design.parts, design.white, design.trusted, strict=True):
        for values, sums in ((white, grams), (_both(design, part)[ORDER:], plain)):
            exact = values[trusted].astype(np.float64)
            sums.append(exact.T @ exact)
        rows.append(int(trusted.sum()))
    design.blocks = Blocks(np.array(grams), np.array(rows, dtype=float), np.array(plain))


def extend(design: Design, columns: list[Floats]) -> NDArray[np.int64]:
    """Add columns ([T, k] per stretch); their places."""
    first, count = design.blocks.y, columns[0].shape[1]
    size = design.blocks.grams.shape[1]
    old = np.concatenate([np.arange(first), [first + count]])
    for name in ("grams", "plain"):
        grams = np.zeros((len(design.parts), size + count, size + count))
        grams[:, old[:, None], old] = getattr(design.blocks, name)
        setattr(design.blocks, name, grams)
    for number, values in enumerate(columns):
        design.raw[number] = np.concatenate([design.raw[number], values.astype(np.float32)], axis=1)
    for number, white in enumerate(design.white):
        room = np.zeros((len(white), count), dtype=np.float32)
        design.white[number] = np.concatenate([white[:, :first], room, white[:, first:]], axis=1)
    places = np.arange(first, first + count)
    replace_columns(design, places, columns)
    return places


def replace_columns(design: Design, places: NDArray[np.int64], columns: list[Floats]) -> None:
    """Other values ([T, k] per stretch) at `places`."""
    for number, values in enumerate(columns):
        design.raw[number][:, places] = values
    for number, part in enumerate(design.parts):
        values = columns[part.segment][part.rows]
        gram, plain = design.blocks.grams[number], design.blocks.plain[number]
        gram[places, :] = gram[:, places] = plain[places, :] = plain[:, places] = 0.0
        if not values.any():
            design.white[number][:, places] = 0.0
            continue
        white = design.whitener.apply(values)
        design.white[number][:, places] = white
        trusted = design.trusted[number]
        products = design.white[number][trusted].T.astype(np.float64) @ white[trusted].astype(np.float64)
        gram[:, places] = products
        gram[places, :] = products.T
        everything = _both(design, part)[ORDER:][trusted].astype(np.float64)
        products = everything.T @ values[ORDER:][trusted]
        plain[:, places] = products
        plain[places, :] = products.T
