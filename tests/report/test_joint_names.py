"""The robot's own names of joints, wherever people read."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from acqd.report.head import read_head
from acqd.report.joint_names import all_with_joint_names, with_joint_names
from acqd.report.page import Page
from acqd.report.verdict import Verdict

MILL = ["X1", "Y", "spindle_joint"]


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("viscous_friction (joint 1)", "viscous_friction (joint X1)"),
        ("a friction of joint 2 that grows with the speed of joint 3.", "a friction of joint Y that grows with the "
         "speed of spindle_joint."),
        ("joint 4, joint 0, joint 12 and all joints, each joint", None), ("joint 1st, myjoint 1, joint_1", None),
    ],
)  # fmt: skip
def test_numbers_become_the_names_of_the_robot(text, named):
    assert with_joint_names(text, MILL) == (named or text) and with_joint_names(text, []) == text


def test_a_value_is_named_for_people_and_stays_as_it_is_for_programs():
    told = {"effects": [{"where": "joint 2", "parameters": {"coefficient joint 2": {"value": 2.0}}}], "rows": (1, None)}
    named = all_with_joint_names(told, MILL)
    assert named["effects"][0] == {"where": "joint Y", "parameters": {"coefficient joint Y": {"value": 2.0}}}
    assert told["effects"][0]["where"] == "joint 2" and named["rows"] == (1, None)


@given(st.text(), st.lists(st.text(), max_size=3))
def test_no_text_and_no_names_are_too_odd(text, names):
    assert isinstance(with_joint_names(text, names), str)


def test_a_page_names_joints_in_verdict_table_and_head(tmp_path):
    page = Page("T", simulated=True, joints=["X<1\\", "Y"])
    page.verdict(Verdict("found", "Cause found: viscous_friction (joint 2)", "joint 1 is slow"))
    page.table(["cause", "joint 2"], [["joint 1", "1"]])
    text = page.html()
    assert "joint 2" not in text and text.count("joint Y") >= 3
    assert "joint X&lt;1&#92; is slow" in text and "X<1" not in text
    (tmp_path / "page.html").write_text(text)
    assert read_head(tmp_path / "page.html").verdict.headline == "Cause found: viscous_friction (joint Y)"
