"""Descriptions of terminals, their codes, and the uncertainty budgets of described boxes."""

from __future__ import annotations

import math

import numpy as np
import pytest

from acqd.conformance.budget import budgets
from acqd.conformance.terminal import Terminal, load_terminal
from acqd.errors import InputError


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("bits = 40", "bits: "),
        ("colour = 1", "unknown key colour"),
        ("max_current = 9.0", "peak beyond the range"),
        ("declared_voltage = 600", "beyond the range of 737"),
        ("rate = ", "is not valid TOML"),
        ('[transformers]\ncurrent = "7"', "transformers.current: "),
    ],
)
def test_a_description_that_cannot_be_used_is_refused_in_one_line(tmp_path, text, said):
    file = tmp_path / "box.toml"
    file.write_text(text)
    with pytest.raises(InputError, match=said) as error:
        load_terminal(file)
    assert "\n" not in str(error.value) and str(file) in str(error.value)


@pytest.mark.parametrize("bits", [12, 16, 24])
def test_codes_are_within_half_a_step_and_clip_at_the_end_of_the_range(bits):
    terminal = Terminal(bits=bits, noise_digits=0.0)
    samples = np.outer(np.linspace(-0.9, 0.9, 101), [terminal.range_v, terminal.range_a] * 3)
    again = terminal.codes(samples, 0) * np.array(terminal.form.scale)
    step = np.array([terminal.range_v, terminal.range_a] * 3) * 2 / 2**bits
    assert (np.abs(again - samples) <= 0.5001 * step).all()
    beyond = terminal.codes(np.full((1, 6), 1e4), 0)
    assert (beyond == terminal.form.code_max).all()


def test_a_budget_is_the_root_of_the_sum_of_squares_of_its_components():
    """By hand: 0.2 % and class 0.5 as rectangular distributions, 5 us at a power factor of 0.5."""
    assert budgets(Terminal(), []) == []
    terminal = Terminal.model_validate(
        {"noise_digits": 0.0, "uncertainty": {"gain_percent": 0.2, "delay_us": 5.0}, "transformers": {"current": "0.5"}}
    )
    V, I, _, P, f = budgets(terminal, [])  # noqa: E741
    assert V.expanded == pytest.approx(2 * 0.2 / math.sqrt(3), rel=1e-4) and V.passed is False
    assert I.expanded == pytest.approx(2 * math.hypot(0.2, 0.5) / math.sqrt(3), rel=1e-4) and I.passed is None
    angles = math.hypot(2 * math.pi * 50 * 5e-6, 30 / 60 * math.pi / 180) * math.tan(math.acos(0.5)) * 100
    expected = 2 * math.sqrt(0.2**2 + 0.2**2 + 0.5**2 + angles**2) / math.sqrt(3)
    assert P.expanded == pytest.approx(expected, rel=1e-4)
    assert f.expanded == 0 and f.passed is True
