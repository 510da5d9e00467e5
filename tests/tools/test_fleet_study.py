"""The study of fleets: who hides what, from when on, and what a report is worth."""

import numpy as np

from tests.fleet.findings import START_S, hall
from tools.studies.fleet.cases import OWN, Scale, begun, cases, plant_of
from tools.studies.fleet.judge import judged
from tools.studies.foreign.generator.hidden.effect import Hidden

SCALE = Scale(200, 60.0, 20.0, 20, 15, "viscous_friction", 1)


def test_of_200_robots_20_hide_an_effect_and_15_of_these_the_shared_one():
    found = cases(SCALE)
    assert len({case.name for case in found}) == 200
    assert sum(case.cause is not None for case in found) == 20 and sum(case.shared for case in found) == 15
    assert {case.cause for case in found if case.shared} == {"viscous_friction"}
    assert {case.cause for case in found if case.cause and not case.shared} == set(OWN)
    assert found == cases(SCALE)


def test_robots_of_a_type_have_one_arm_and_friction_of_their_own():
    first, second = plant_of(SCALE, 0), plant_of(SCALE, 1)
    assert [body.mass for body in first.arm.bodies] == [body.mass for body in second.arm.bodies]
    assert (first.friction.dry != second.friction.dry).all()
    assert (np.abs(first.friction.dry / second.friction.dry - 1) < 0.51).all()


def test_an_effect_acts_from_its_onset_on():
    effect = Hidden(id="x", place="", torque=np.ones((4, 2)), drives=lambda tau, power, size: size * power)
    late = begun(effect, np.array([False, False, True, True]))
    assert late.torque.sum(axis=1).tolist() == [0, 0, 2, 2] and late.load is None
    assert late.drives(None, np.full(4, 3.0), 2.0).tolist() == [0, 0, 6, 6]


def test_a_report_is_judged_by_what_was_hidden(tmp_path):
    _, report = hall(tmp_path)
    shared = {f"cell-{3 * k:03d}": START_S + 40_000 for k in range(9)}
    secrets = {
        row["name"]: {
            "cause": "viscous_friction" if row["name"] in shared else None, "shared": row["name"] in shared,
            "onset_s": shared.get(row["name"]),
        }
        for row in report.robots
    }  # fmt: skip
    secrets["cell-001"] |= {"cause": "payload", "onset_s": START_S + 9_000}
    secrets["cell-002"] |= {"cause": "payload", "onset_s": START_S}
    result = judged(report.as_json(), secrets)
    assert (result["hidden"], result["found"], result["missed"]) == (11, 10, ["cell-002"])
    assert result["false"] == ["cell-004"] and result["named"] == 10 and result["failed"] == 1
    assert result["shared"]["right"] and result["shared"]["of_true"] == 9 and result["shared"]["wrong"] == []
