"""Sampled values that do not arrive as such."""

from __future__ import annotations

import pytest

from acqd.sources.sampled_values.elsewhere import advice

ADDRESSES = bytes(12)


@pytest.mark.parametrize(
    ("frame", "said"),
    [
        ("892f 0042 0001 88ba", "HSR ring"),
        ("8100 0005 88ba 4000", "two VLAN tags"),
        ("88b8 0001", "GOOSE arrive, so the cable is right"),
        ("0800 4500", "check cable and merging unit"),
    ],
)
def test_tags_and_other_traffic_are_named(frame, said):
    assert said in advice("eth1", [ADDRESSES + bytes.fromhex(frame.replace(" ", "")) + bytes(40)])
