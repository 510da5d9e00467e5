"""Selection and acceptance."""

from __future__ import annotations

from dataclasses import dataclass

from acqd.discrepancy.thresholds.threshold import threshold


@dataclass(frozen=True)
class SelectionThresholds:
    """Selection and acceptance."""

    least_evidence: float = threshold(
        20.0,
        "white squared error",
        "selection",
        "study",
        "least evidence; with so many rows, significance is no hurdle",
    )
    chance: float = threshold(
        0.02,
        "probability",
        "selection",
        "convention",
        "probability that clean recordings surprise more (wild block bootstrap)",
    )
    chance_draws: int = threshold(999, "draws", "selection", "convention", "draws of the wild block bootstrap")
    spread_chance: float = threshold(
        0.003,
        "probability",
        "selection",
        "choice",
        "probability that two unchanged sessions differ more; a search over a hundred candidates has to pay",
    )
    consistent_share: float = threshold(
        0.6, "-", "selection", "study", "least share of recordings that agree with the pooled estimate"
    )
    plain_errors: float = threshold(
        2.0, "standard errors", "selection", "convention", "held-out gain of the error in W may be negative by so much"
    )
    active_share: float = threshold(
        0.01, "-", "selection", "study", "a recording counts if the effect has this share of its largest power there"
    )
    least_column_power: float = threshold(
        1e-3, "white squared error", "selection", "choice", "columns below never act, or the model has them already"
    )
    bounds_slack: float = threshold(
        2.0, "standard errors", "selection", "convention", "a single parameter may lie outside of its bounds by so much"
    )
    score_ridge: float = threshold(
        1e-3, "-", "selection", "choice", "share of the Schur complement added to the blocks' covariance of scores"
    )
    unanimous_recordings: int = threshold(5, "recordings", "selection", "study", "fewest recordings for unanimity")
    unanimous_share: float = threshold(0.9, "-", "selection", "study", "share of recordings that is called unanimous")
    unanimous_evidence: float = threshold(
        120.0, "white squared error", "selection", "study", "unanimous recordings with more evidence need no surprise"
    )
    few_recordings: int = threshold(3, "recordings", "selection", "study", "fewest recordings, all agreeing and loud")
    few_evidence: float = threshold(
        1000.0, "white squared error", "selection", "study", "least evidence of few recordings without a reference"
    )
    few_held_out_share: float = threshold(
        0.5, "-", "selection", "study", "held-out gain of few recordings, relative to their evidence, at least"
    )
    alternative_margin: float = threshold(
        40.0,
        "white squared error",
        "selection",
        "study",
        "an unnamed alternative wins if it exceeds the effect by this plus alternative_share of the effect",
    )
    alternative_share: float = threshold(0.02, "-", "selection", "study", "see alternative_margin")
    doubted_steps: int = threshold(
        2,
        "effects",
        "selection",
        "choice",
        "so many more effects may clear a doubt about an earlier one, two causes at once being rare",
    )
    coarse_factor: float = threshold(
        1.3, "-", "selection", "study", "refining a shape is assumed to gain no more evidence than this factor"
    )
    later_share: float = threshold(
        0.03,
        "-",
        "selection",
        "study",
        "least evidence of a later effect, relative to an earlier one: the error of its shape",
    )
    neighbour_share: float = threshold(
        0.12, "-", "selection", "study", "the same for a neighbour of the earlier effect"
    )
    earlier_error: float = threshold(
        0.15,
        "-",
        "selection",
        "choice",
        "relative error of the power of earlier effects: masses, torques and friction of the description",
    )
    onset_factor: float = threshold(
        1.05, "-", "selection", "study", "an onset must explain more by this factor and by onset_margin"
    )
    onset_margin: float = threshold(40.0, "white squared error", "selection", "study", "see onset_factor")
    onset_fewest: int = threshold(3, "recordings", "selection", "study", "fewest recordings before and after an onset")
    clock_smallest_s: float = threshold(
        0.006, "s", "selection", "study", "smaller clock offsets are differences of two alignments, not effects"
    )
    clock_agreement: float = threshold(
        0.5, "-", "selection", "study", "a clock offset must agree with the shift of whole recordings to this share"
    )
    least_share_of_range: float = threshold(
        0.0025,
        "-",
        "selection",
        "physics",
        "least RMS while acting, relative to the dynamic range: nobody would act on less",
    )
    level_span_s: float = threshold(
        900.0, "s", "selection", "physics", "a shorter reference does not show the drift of the standby power"
    )
    level_share_of_range: float = threshold(
        0.015, "-", "selection", "study", "least change of a level beside such a reference, as a share of the range"
    )
    level_steady: float = threshold(
        0.9, "-", "selection", "choice", "a level has this share of its mean square in the means of the blocks"
    )
    acting_share: float = threshold(
        0.05, "-", "selection", "choice", "an effect acts where its power exceeds this share of its largest power"
    )
    event_share: float = threshold(0.15, "-", "selection", "study", "an effect in a smaller share of rows is transient")
    event_power: float = threshold(
        0.01, "-", "selection", "study", "a transient effect's rows: above this share of its largest power"
    )
