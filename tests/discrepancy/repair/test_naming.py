"""Which effects keep their names."""

from types import SimpleNamespace

import numpy as np

from acqd.discrepancy.repair.naming import without_unproven
from acqd.discrepancy.repair.usual_error import UsualError
from acqd.discrepancy.selection.accepted import Tracing
from tests.builders import grey, recording
from tests.discrepancy.report.subjects import found


def test_what_may_be_zero_is_no_finding_in_an_error_that_has_not_grown():
    certain = found("coulomb_friction", {"torque": (0.9, 0.5)})
    unproven = found("mechanical_power", {"share": (0.067, 0.07)}, where="joint 6", unit="-")
    partly = found("payload", {"mass": (1.0, 0.4), "first moment x": (0.0, 0.02)}, where="flange", unit="kg")
    tracing = Tracing(design=None, regression=None)
    effects, notes = without_unproven([certain, unproven, partly], tracing)
    assert effects == [certain, partly]
    assert notes == ["mechanical_power (joint 6) may be zero, in an error that has not grown: no finding"]
    assert [(each.id, each.missing) for each in tracing.hypotheses] == [
        ("mechanical_power", ["an error that has grown, or a size whose 95 % interval excludes zero"])
    ]


def test_the_usual_error_is_that_of_the_reference_or_the_noise_floor():
    model = grey()
    alone = SimpleNamespace(model=model, reference=[])
    assert UsualError.of(alone, 0.4).lowest_W == 0.4 and UsualError.of(alone, 0.4).reference_rms is None
    assert UsualError.of(alone, 0.4).exceeded_by([np.zeros(5)])  # nothing can be said
    with_reference = SimpleNamespace(model=model, reference=[recording(model, 3, rows=200)])
    usual = UsualError.of(with_reference, 0.4)
    assert usual.lowest_W == usual.reference_rms > usual.varying_W
    assert usual.exceeded_by([np.full(5, 1.01 * usual.lowest_W)]) and not usual.exceeded_by([np.zeros(5)])
