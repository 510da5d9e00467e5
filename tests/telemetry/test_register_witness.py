"""Registers that began below what the broker has kept of an earlier run."""

from __future__ import annotations

import json

import pytest

from acqd.telemetry.register_witness import RegisterWitness

TOPIC = "acqd/cell1/L1/summary"


def summary(boot, imported, exported=0.0, **changes):
    about = {"device": "cell1", "channel": "L1", "boot": boot, "time": "2026-03-01T00:00:00Z"}
    return {**about, "W_import": imported, "W_export": exported, **changes}


def kept(witness, *of, retained=True, **changes):
    witness.heard(TOPIC, json.dumps(summary(*of, **changes)).encode(), retained=retained)


def test_an_older_state_that_was_put_back_is_said_with_both_readings():
    witness = RegisterWitness(["cell1"])
    kept(witness, "a", 12.5)
    kept(witness, "b", 12.0)  # what this run has published itself, after the connection was lost
    witness.began(summary("b", 11.25, channel="L2"))
    assert witness.subscriptions() == [TOPIC] and not witness.trouble
    witness.began(summary("b", 11.25))
    witness.began(summary("b", 13.0))
    assert "W of cell1 began at 11.25 kWh, and an earlier run had published 12.5 kWh at 2026-03-01" in witness.trouble


@pytest.mark.parametrize(
    ("before", "now"),
    [
        (("a", 12.5, 1.0), ("b", 12.5, 1.0)),  # a restart
        (("a", 12.5, 1.0), ("b", 12.6, 1.1)),
        (("b", 12.5, 1.0), ("b.1", 12.0, 1.0)),  # the same daemon, whose clock was set back
        (("a", 12.5, 1.0), ("b", 12.5 - 1e-12, 1.0)),  # digits that the summary has and the file has not
    ],
)
def test_a_restart_says_nothing(before, now):
    witness = RegisterWitness(["cell1"])
    kept(witness, *before)
    witness.began(summary(*now))
    assert not witness.trouble


def test_exported_energy_goes_back_too_and_what_comes_while_the_run_lasts_is_no_witness():
    witness = RegisterWitness(["cell1"])
    witness.began(summary("b", 1.0, 2.0))
    kept(witness, "x", 99.0, retained=False)
    for payload in (b"", b"offline", b"[]", b'{"boot": 1}', json.dumps(summary("a", "x")).encode()):
        witness.heard(TOPIC, payload, retained=True)
    assert not witness.trouble
    kept(witness, "a", 1.0, 2.5)
    assert "W_export of cell1 began at 2 kWh" in witness.trouble
    assert RegisterWitness([]).subscriptions() == []
