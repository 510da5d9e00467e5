"""The thresholds that decide a verdict: value, unit, meaning and where the value comes from.

Grids of searches (starting values, dwell times) and numerical floors stay with their methods.

Sources: "convention" is common statistical practice; "choice" is a definition that could have been made otherwise;
"study" was set by hand on simulated plants while the methods were developed, with seeds that nobody recorded, and
`python -m tools.studies.effects` judges the result on other campaigns; "physics" follows from what robots do.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any, Literal

Stage = Literal["recordings", "delay", "noise", "detectors", "selection", "uncertainty", "verdict", "joints", "monitor"]


def _threshold(value: float, unit: str, stage: Stage, source: str, meaning: str) -> Any:
    metadata = {"unit": unit, "stage": stage, "source": source, "meaning": meaning}
    return field(default=value, metadata=metadata)


@dataclass(frozen=True, slots=True)
class Thresholds:
    """The thresholds of the loop and of the monitor."""

    # recordings
    fewest_recordings: int = _threshold(
        4,
        "recordings",
        "recordings",
        "choice",
        "fewest recordings for which a jackknife over recordings has a spread",
    )
    shortest_total_s: float = _threshold(
        20.0, "s", "recordings", "study", "shortest duration of all recordings together"
    )
    fewest_for_one_in_five: int = _threshold(
        12,
        "recordings",
        "recordings",
        "convention",
        "with fewer recordings, every fourth is held out instead of every fifth",
    )
    held_out_share: float = _threshold(0.2, "-", "recordings", "convention", "share of recordings that are held out")
    few_every: int = _threshold(4, "recordings", "recordings", "choice", "every which recording is held out of few")
    # delay between power and motion
    delay_reach_s: float = _threshold(0.8, "s", "delay", "study", "longest delay that is tried")
    delay_step_s: float = _threshold(0.02, "s", "delay", "choice", "distance of tried delays")
    delay_smallest_s: float = _threshold(
        0.012, "s", "delay", "study", "smaller delays compete as an effect with the other effects"
    )
    delay_floor_s: float = _threshold(
        0.001, "s", "delay", "study", "error of every delay besides its scatter: motion between rows, the supply's lag"
    )
    delay_least_gain: float = _threshold(
        0.15, "-", "delay", "study", "least share of the residual's variance that the delay must explain"
    )
    delay_least_moving_W: float = _threshold(
        3.0, "W", "delay", "study", "least standard deviation of the predicted power for a delay to be measurable"
    )
    delay_fewest_recordings: int = _threshold(3, "recordings", "delay", "choice", "fewest recordings with a delay")
    delay_fewest_rows: int = _threshold(50, "rows", "delay", "study", "fewest rows inside the range of tried delays")
    delay_significance: float = _threshold(4.0, "standard errors", "delay", "study", "significance of a constant delay")
    drift_deviation: float = _threshold(
        30e-6, "s/s", "delay", "physics", "prior deviation of the drift between two clocks: quartz crystals"
    )
    drift_significance: float = _threshold(5.0, "standard errors", "delay", "study", "significance of a drifting delay")
    drift_least_gain: float = _threshold(
        0.6, "-", "delay", "study", "scatter about the drift, relative to the scatter about a constant, at most"
    )
    # noise model and outliers
    noise_order: int = _threshold(30, "rows", "noise", "study", "order of the autoregressive noise model")
    noise_piece_rows: int = _threshold(
        1250, "rows", "noise", "choice", "pieces whose mean is removed before the noise model is fitted"
    )
    noise_clip: float = _threshold(
        5.0, "sigma", "noise", "convention", "residuals are clipped there for the noise model"
    )
    fewest_for_noise: int = _threshold(
        4, "recordings", "noise", "study", "with fewer reference recordings, the noise model uses all recordings"
    )
    block_rows: int = _threshold(
        1500, "rows", "noise", "study", "longest block: unit of cross-validation and bootstrap"
    )
    block_least_rows: int = _threshold(
        40, "rows", "noise", "choice", "shortest block; a segment of two seconds has more rows of known motion"
    )
    outlier: float = _threshold(
        6.0, "sigma", "noise", "choice", "white residuals of a fit of everything beyond are left out"
    )
    intercept_least_W: float = _threshold(
        1e-3, "W", "noise", "choice", "least standard deviation of the random intercepts of blocks"
    )
    lag_deviation_s: float = _threshold(
        0.003, "s", "noise", "study", "prior deviation of the supply's lag, which else trades against clock offsets"
    )
    withheld_deviation: float = _threshold(
        1e-9, "unit of the parameter", "noise", "choice", "prior deviation that holds a withheld parameter at zero"
    )
    base_change: float = _threshold(
        1.0, "-", "noise", "study", "prior deviation of friction and losses of the base model, relative to their values"
    )
    base_least_change: float = _threshold(
        0.02, "of the torque limit", "noise", "study", "the same where the values are small; also W per W/Nm of loss"
    )
    common_share: float = _threshold(
        0.01,
        "-",
        "noise",
        "study",
        "mean power of a column in the reference, relative to the recordings in question, "
        "above which both share the column",
    )
    # detectors in the residual
    detected_evidence: float = _threshold(
        250.0, "white squared error", "detectors", "study", "least evidence of an effect detected in the residual"
    )
    reference_factor: float = _threshold(
        3.0, "-", "detectors", "study", "a detected effect must exceed the reference's gain by this factor (2 x 1.5)"
    )
    detected_worth: float = _threshold(
        1.33, "-", "detectors", "study", "evidence of a detected effect is divided by this factor in the ranking"
    )
    predictive_share: float = _threshold(
        0.5,
        "-",
        "detectors",
        "study",
        "an unnamed alternative with more than this share of its evidence refutes a detected effect",
    )
    ripple_cost: float = _threshold(
        6.0, "parameters", "detectors", "study", "parameters charged for the search of a ripple"
    )
    ripple_fewest_periods: float = _threshold(
        3.0, "per turn", "detectors", "physics", "slowest ripple that is searched"
    )
    ripple_most_periods: float = _threshold(
        130.0, "per turn", "detectors", "physics", "fastest ripple that is searched"
    )
    switching_price: float = _threshold(
        7.0, "log-likelihood", "detectors", "study", "price of a switching in the Viterbi path"
    )
    switching_rarest: float = _threshold(0.005, "-", "detectors", "study", "least share of time on, and of time off")
    walk_s: float = _threshold(
        20.0, "s", "detectors", "choice", "a moving average over this time must explain less than a load that switches"
    )
    contact_longest: float = _threshold(
        0.6, "-", "detectors", "study", "a contact for a larger share of the time is a load, not a contact"
    )
    rhythm_regular: float = _threshold(
        0.33, "correlation", "detectors", "study", "regularity from which a load has a rhythm"
    )
    rhythm_shortest_s: float = _threshold(
        12.0, "s", "detectors", "physics", "no heater or fan switches with a shorter period"
    )
    rhythm_fewest_pairs: int = _threshold(
        100, "pairs", "detectors", "study", "fewest pairs of states for a correlation at a distance in time"
    )
    rhythm_near_best: float = _threshold(
        0.85, "-", "detectors", "study", "the shortest period with this share of the best regularity is the period"
    )
    # selection and acceptance
    least_evidence: float = _threshold(
        20.0,
        "white squared error",
        "selection",
        "study",
        "least evidence; with so many rows, significance is no hurdle",
    )
    chance: float = _threshold(
        0.02,
        "probability",
        "selection",
        "convention",
        "probability that clean recordings surprise more (wild block bootstrap)",
    )
    chance_draws: int = _threshold(999, "draws", "selection", "convention", "draws of the wild block bootstrap")
    spread_chance: float = _threshold(
        0.003,
        "probability",
        "selection",
        "choice",
        "probability that two unchanged sessions differ more; a search over a hundred candidates has to pay",
    )
    consistent_share: float = _threshold(
        0.6, "-", "selection", "study", "least share of recordings that agree with the pooled estimate"
    )
    plain_errors: float = _threshold(
        2.0, "standard errors", "selection", "convention", "held-out gain of the error in W may be negative by so much"
    )
    active_share: float = _threshold(
        0.01, "-", "selection", "study", "a recording counts if the effect has this share of its largest power there"
    )
    least_column_power: float = _threshold(
        1e-3, "white squared error", "selection", "choice", "columns below never act, or the model has them already"
    )
    bounds_slack: float = _threshold(
        2.0, "standard errors", "selection", "convention", "a single parameter may lie outside of its bounds by so much"
    )
    score_ridge: float = _threshold(
        1e-3, "-", "selection", "choice", "share of the Schur complement added to the blocks' covariance of scores"
    )
    unanimous_recordings: int = _threshold(5, "recordings", "selection", "study", "fewest recordings for unanimity")
    unanimous_share: float = _threshold(0.9, "-", "selection", "study", "share of recordings that is called unanimous")
    unanimous_evidence: float = _threshold(
        120.0, "white squared error", "selection", "study", "unanimous recordings with more evidence need no surprise"
    )
    few_recordings: int = _threshold(3, "recordings", "selection", "study", "fewest recordings, all agreeing and loud")
    few_evidence: float = _threshold(
        1000.0, "white squared error", "selection", "study", "least evidence of few recordings without a reference"
    )
    few_held_out_share: float = _threshold(
        0.5, "-", "selection", "study", "held-out gain of few recordings, relative to their evidence, at least"
    )
    alternative_margin: float = _threshold(
        40.0,
        "white squared error",
        "selection",
        "study",
        "an unnamed alternative wins if it exceeds the effect by this plus alternative_share of the effect",
    )
    alternative_share: float = _threshold(0.02, "-", "selection", "study", "see alternative_margin")
    doubted_steps: int = _threshold(
        2,
        "effects",
        "selection",
        "choice",
        "so many more effects may clear a doubt about an earlier one, two causes at once being rare",
    )
    coarse_factor: float = _threshold(
        1.3, "-", "selection", "study", "refining a shape is assumed to gain no more evidence than this factor"
    )
    later_share: float = _threshold(
        0.03,
        "-",
        "selection",
        "study",
        "least evidence of a later effect, relative to an earlier one: the error of its shape",
    )
    neighbour_share: float = _threshold(
        0.12, "-", "selection", "study", "the same for a neighbour of the earlier effect"
    )
    earlier_error: float = _threshold(
        0.15,
        "-",
        "selection",
        "choice",
        "relative error of the power of earlier effects: masses, torques and friction of the description",
    )
    onset_factor: float = _threshold(
        1.05, "-", "selection", "study", "an onset must explain more by this factor and by onset_margin"
    )
    onset_margin: float = _threshold(40.0, "white squared error", "selection", "study", "see onset_factor")
    onset_fewest: int = _threshold(3, "recordings", "selection", "study", "fewest recordings before and after an onset")
    clock_smallest_s: float = _threshold(
        0.006, "s", "selection", "study", "smaller clock offsets are differences of two alignments, not effects"
    )
    clock_agreement: float = _threshold(
        0.5, "-", "selection", "study", "a clock offset must agree with the shift of whole recordings to this share"
    )
    least_share_of_range: float = _threshold(
        0.0025,
        "-",
        "selection",
        "physics",
        "least RMS while acting, relative to the dynamic range: nobody would act on less",
    )
    level_span_s: float = _threshold(
        900.0, "s", "selection", "physics", "a shorter reference does not show the drift of the standby power"
    )
    level_share_of_range: float = _threshold(
        0.015, "-", "selection", "study", "least change of a level beside such a reference, as a share of the range"
    )
    level_steady: float = _threshold(
        0.9, "-", "selection", "choice", "a level has this share of its mean square in the means of the blocks"
    )
    acting_share: float = _threshold(
        0.05, "-", "selection", "choice", "an effect acts where its power exceeds this share of its largest power"
    )
    event_share: float = _threshold(
        0.15, "-", "selection", "study", "an effect in a smaller share of rows is transient"
    )
    event_power: float = _threshold(
        0.01, "-", "selection", "study", "a transient effect's rows: above this share of its largest power"
    )
    # uncertainty
    resamples: int = _threshold(
        40, "draws", "uncertainty", "choice", "bootstrap draws of recordings for the confidence"
    )
    contenders: int = _threshold(
        6, "effects", "uncertainty", "study", "alternative effects that take part in the bootstrap"
    )
    unnamed_contenders: int = _threshold(
        3, "alternatives", "uncertainty", "choice", "unnamed alternatives that take part in the bootstrap"
    )
    shape_step: float = _threshold(
        0.1, "-", "uncertainty", "choice", "step of a fitted shape for its interval, relative to the value"
    )
    interval_width: float = _threshold(
        1.96, "standard errors", "uncertainty", "convention", "half width of a 95 % interval"
    )
    jackknife_fewest: int = _threshold(3, "recordings", "uncertainty", "choice", "fewest recordings for a jackknife")
    drive_scale_deviation: float = _threshold(
        0.10,
        "-",
        "uncertainty",
        "choice",
        "relative standard deviation of nominal drive gains and of the supply's gain",
    )
    sensor_scale_deviation: float = _threshold(
        0.02, "-", "uncertainty", "physics", "relative standard deviation of a torque sensor's scale"
    )
    scale_segments: int = _threshold(
        60, "segments", "uncertainty", "choice", "most segments that a scale is taken from"
    )
    column_deviation: float = _threshold(
        0.04,
        "-",
        "uncertainty",
        "choice",
        "relative error of an effect's columns by the model's wrong torques and powers",
    )
    # verdict
    enough_s: float = _threshold(
        120.0, "s", "verdict", "study", "with shorter recordings, silence does not prove absence"
    )
    fair_share: float = _threshold(
        0.15, "-", "verdict", "choice", "least share of the excess over the reference that found effects explain"
    )
    grown_quantile: float = _threshold(
        0.95, "-", "verdict", "convention", "quantile of the errors of reference recordings: a larger error has grown"
    )
    grown_factor: float = _threshold(
        1.25,
        "-",
        "verdict",
        "choice",
        "by which the error of new recordings may exceed that quantile: they were not fitted",
    )
    family_correlation: float = _threshold(
        0.95, "-", "verdict", "convention", "effects whose powers correlate more are one family in these recordings"
    )
    least_confidence: float = _threshold(
        0.85, "-", "verdict", "study", "with less confidence, an effect is a hypothesis and no finding"
    )
    # logged joint torques
    stick_rad_s: float = _threshold(
        0.03, "rad/s", "joints", "physics", "a slower joint may stick, and its motor carries any torque up to breakaway"
    )
    joint_least_rows: int = _threshold(12, "rows", "joints", "choice", "shortest run of motion of a joint")
    joint_noise_order: int = _threshold(10, "rows", "joints", "choice", "order of the noise model of a joint's torque")
    joint_rows_per_order: int = _threshold(
        20,
        "rows",
        "joints",
        "choice",
        "reference rows of a joint per order of its noise model, at least",
    )
    joint_longest_s: float = _threshold(
        1200.0, "s", "joints", "choice", "longest duration of logged torques of one side that is used"
    )
    friction_spread: float = _threshold(
        0.15, "-", "joints", "choice", "relative standard deviation of friction from session to session (UR10e)"
    )
    usual_dispersion: float = _threshold(
        30.0, "-", "joints", "choice", "mean square of z in unchanged sessions (UR10e), before sessions were compared"
    )
    few_sessions: float = _threshold(
        3.0, "sessions", "joints", "choice", "weight of usual values against the spread of the reference sessions"
    )
    torque_least_Nm: float = _threshold(
        0.3, "Nm", "joints", "physics", "least RMS difference of a logged torque that is called a change"
    )
    joint_growth: float = _threshold(
        1.5, "-", "joints", "choice", "a joint has changed if its RMS difference has grown by this factor"
    )
    joint_evidence: float = _threshold(
        12.0, "twice log-likelihood ratio", "joints", "convention", "logged torques show an effect (p < 0.001)"
    )
    # sequential test
    cusum_block_s: float = _threshold(10.0, "s", "monitor", "study", "duration of a block of the charts")
    cusum_clip: float = _threshold(
        4.0, "sigma", "monitor", "study", "bound of one block's contribution: a protective stop is no change"
    )
    cusum_slack: float = _threshold(
        0.75, "sigma", "monitor", "convention", "slack k of the CUSUM: shifts of twice this size are found soonest"
    )
    cusum_moving_W: float = _threshold(
        2.0, "W", "monitor", "study", "standard deviation of predicted power of a moving block"
    )
    cusum_rest_s: float = _threshold(0.5, "s", "monitor", "study", "a recording starts at rest: at least so long")
    cusum_peak_s: float = _threshold(0.2, "s", "monitor", "study", "a peak at the start is a mean over this time")
    cusum_tail_share: float = _threshold(
        0.1, "of the rows", "monitor", "convention", "high and low power: beyond the upper and the lower decile"
    )
    cusum_fewest_blocks: int = _threshold(12, "blocks", "monitor", "study", "fewest blocks of a baseline")
    cusum_step: float = _threshold(1.0, "sigma", "monitor", "study", "least step that dates the onset")
    screen_level_share: float = _threshold(
        0.02, "of the dynamic range", "monitor", "study", "drift of the standby power that a fleet's screen ignores"
    )
    cusum_remembered: int = _threshold(2000, "blocks", "monitor", "choice", "blocks kept since a chart left zero")


THRESHOLDS = Thresholds()
"""The values in use."""


def described(stages: set[Stage]) -> list[dict[str, Any]]:
    """Name, value, unit, meaning and source of the thresholds of some stages, for report.json."""
    return [
        {
            "name": each.name,
            "value": getattr(THRESHOLDS, each.name),
            "unit": each.metadata["unit"],
            "meaning": each.metadata["meaning"],
            "source": each.metadata["source"],
        }
        for each in fields(Thresholds)
        if each.metadata["stage"] in stages
    ]
