"""What sessions of the reference differ by is no effect, however well the rows of a new session agree."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acqd.discrepancy.remarks import drifted_level
from acqd.discrepancy.selection.reference_spread import between_sessions
from tests.builders import recording
from tests.discrepancy.independent import COMMON, selected

ONLY = COMMON | {"meter_gain"}


def gain_drifts(model, robot, gain):
    """A meter whose gain is another in every session by 0.6 %; in the session in question it is `gain`."""
    gains = np.random.default_rng(4).normal(0, 0.006, 8)

    def drawn(share):
        return lambda scene, random: share * scene.predicted

    reference = [recording(model, k, drawn(share), seed=1) for k, share in enumerate(gains)]
    question = [recording(model, k, drawn(gain), seed=2, start_s=1e9 + 5000) for k in range(8)]
    return selected(model, robot, question, reference, ONLY)[1]


def test_a_gain_within_the_spread_of_the_reference_is_not_named(model, robot):
    tracing = gain_drifts(model, robot, 0.008)
    assert not tracing.effects and tracing.unknown is None
    known = next(each for each in tracing.hypotheses if each.id == "meter_gain")
    assert known.missing == ["more than what unchanged sessions of the reference differ by"], known


def test_a_gain_beyond_the_spread_is_named(model, robot):
    assert [named.id for named in gain_drifts(model, robot, 0.06).effects] == ["meter_gain"]


@given(st.integers(0, 1000), st.floats(0.05, 2.0))
def test_the_spread_is_that_of_the_sessions(seed, spread):
    random = np.random.default_rng(seed)
    information = random.uniform(2000, 20000, 400)
    amplitudes = random.normal(0, spread, 400) + random.normal(0, information**-0.5)
    assert between_sessions(amplitudes, information) == pytest.approx(spread, rel=0.25)
    assert between_sessions(information**-0.5, information) == pytest.approx(0.0, abs=1e-4)  # white noise only


@pytest.mark.parametrize(("apart_s", "named"), [(60.0, []), (180.0, ["offset_shift"])])
def test_a_small_load_in_three_recordings_needs_a_reference_that_shows_drifts(apart_s, named, model, robot):
    """A steady load cannot surprise in three recordings; the spread of eight unchanged sessions is the scale.

    Within minutes, unchanged sessions do not show how far the standby power drifts.
    """
    reference = [recording(model, k, rows=700, seed=1) for k in range(8)]
    reference = [replace(each, start_s=1e9 + apart_s * k) for k, each in enumerate(reference)]
    question = [recording(model, k, lambda s, _: np.full(s.rows, 1.5), seed=2, start_s=1e9 + 5000) for k in range(3)]
    tracing = selected(model, robot, question, reference, ONLY)[1]
    assert [each.id for each in tracing.effects] == named, tracing.hypotheses[:2]
    if named:
        assert tracing.effects[0].finding.evidence < 1000  # which few recordings without a reference would need
    else:
        assert drifted_level(tracing) == [
            "a constant 1.6 W more than in the reference may be drift of the standby power: a reference of less than "
            "15 min does not show how far that goes"
        ]
