"""A report with every kind of block, as readers see it."""

import json
import math

import numpy as np
import pytest
from matplotlib.figure import Figure

from acqd.report import KeyFigure, Page, Verdict
from acqd.report.arm_view import ArmView, Layer, Motion
from acqd.report.bars import Bar, ranked
from acqd.robot.arm import Arm
from acqd.robot.description import load_description
from acqd.robot.frames import frames_of
from acqd.robot.kinematics import forward_kinematics
from tests.browser import chromium, looks, serious_findings
from tests.report.charts import chart
from tests.robot.sliding import scara

pytestmark = pytest.mark.browser


def arm_view():
    """Two rows of an arm with two axes; the residual of the second is a payload's."""
    description = load_description("iiwa7_r800")
    layer = Layer("standby", "#94a3b8", np.array([[0.0] * 7 + [50.0]] * 2))
    payload = Layer("payload (flange)", "#7c3aed", np.array([[0.0] * 8, [5.0] + [0.0] * 7]))
    q = np.array([[0.0] * 7, [0.0, 0.5, 0.0, -1.4, 0.0, 1.1, 0.0]])
    motion = Motion("run 1", np.array([0.0, 0.1]), q, np.array([50.0, 55.0]), [layer], [payload])
    return ArmView(frames_of(description), [motion], "An arm.")


def the_arm_moves_by_keyboard(view):
    """Values at the slider, the flange where Pinocchio has it, and three.js unpacked when the arm is in sight."""
    assert not view.evaluate("'THREE' in window")
    view.focus(".arm input[type=range]")
    view.keyboard.press("ArrowRight")
    assert view.inner_text(".arm output") == "0.10 s"
    assert "5.0 W" in view.inner_text(".arm .layers li:has-text('payload')")
    view.wait_for_selector(".arm canvas")
    view.keyboard.press("Home")
    assert (
        view.get_attribute(".arm input[type=range]", "aria-valuetext")
        == "0.0 seconds: measured 50.0 W, predicted 50.0 W"
    )
    frames = "JSON.parse(document.querySelector('.moving script').textContent).frames"
    flange = view.evaluate(f"acqdArm.posture({frames}, [0, 0.5, 0, -1.4, 0, 1.1, 0]).points.at(-1)")
    arm = Arm(load_description("iiwa7_r800"))
    wanted, _ = forward_kinematics(arm, np.array([[0.0, 0.5, 0.0, -1.4, 0.0, 1.1, 0.0]]))
    assert np.allclose(flange, wanted[0], atol=1e-5)
    frames, q = json.dumps(frames_of(scara())), [0.3, -0.5, -1.0, 0.2]
    wanted, _ = forward_kinematics(Arm(scara()), np.array([q]))
    assert np.allclose(view.evaluate(f"acqdArm.posture({frames}, {q}).points.at(-1)"), wanted[0], atol=2e-5)
    assert view.evaluate(f"acqdArm.reach({frames})") == pytest.approx(0.3 + 0.4 + 0.3 + math.hypot(0.01, 0.1) + 0.1 + 1)


def test_a_report_has_no_serious_accessibility_finding_and_shows_its_values(tmp_path):
    figure = Figure(figsize=(9, 3))
    figure.subplots().plot([1, 2])
    page = Page("Everything", simulated=True)
    for tone in ("found", "fine", "open", "bad"):
        page.verdict(Verdict(tone, f"A verdict: {tone}", "why", [KeyFigure("mass", "1 kg", "note")], ["do this"]))
        for name in ("One", "Two", "Three"):
            page.heading(name)
        page.table(["name", "value [W]", "a long explanation in words"], [["P", 1.0, "measured at the mains " * 9]])
        page.figure(figure, "A line")
        page.bars(ranked([Bar("best", 2.0, "2 W"), Bar("worst", 1.0, "1 W", "muted")], "power [W]"), "")
        page.lines(chart(), "A minute.")
        if tone == "bad":
            page.arm(arm_view())
        page.write(tmp_path / f"{tone}.html")
    with chromium() as browser:
        for view in looks(browser):
            for tone in ("found", "fine", "open", "bad") if view.rules is None else ("bad",):
                view.goto((tmp_path / f"{tone}.html").as_uri())
                assert serious_findings(view) == [] and view.errors == []
            view.focus(".chart [tabindex]")
            for key in ("Home", "ArrowRight"):
                view.keyboard.press(key)
            assert "time [s]: 0.04" in view.inner_text(".readout")
            if view.rules is None:
                the_arm_moves_by_keyboard(view)
