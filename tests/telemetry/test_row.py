"""Rows on the wire."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from acqd.metering import Meter, SampleBlock, StreamFormat
from acqd.telemetry.row import CHANNELS, PowerRow, parse_each, parse_row, rows_of
from tests.mains import make_mains
from tests.telemetry.rows import some_rows

FIELDS = [
    "device",
    "channel",
    "boot",
    "seq",
    "time",
    "filetime",
    "Vrms",
    "Irms",
    "P",
    "S",
    "PF",
    "f",
    "W",
    "flags",
    "schema",
]


def test_a_row_has_exactly_the_fixed_fields_in_order():
    _, _, rows = some_rows()
    plain = json.loads(rows[0].to_json())
    assert list(plain) == FIELDS
    assert plain["device"] == "cell1" and plain["schema"] == 1 and plain["flags"] == ["start"]
    assert plain["time"] == "2021-07-13T08:15:30.123456Z"
    assert plain["filetime"] == 1_626_164_130_123_456_789 // 100 + 116_444_736_000_000_000


def test_channels_are_the_phases_and_with_several_the_total():
    _, _batch, rows = some_rows()
    assert [row.channel for row in rows[:5]] == ["L1", "L2", "L3", "total", "L1"]
    total = rows[3]
    assert pytest.approx(sum(row.P for row in rows[:3])) == total.P
    assert pytest.approx(sum(row.S for row in rows[:3])) == total.S
    assert pytest.approx(sum(row.W for row in rows[:3])) == total.W
    assert pytest.approx(total.P / total.S) == total.PF
    _, _, single = some_rows(phases=1)
    assert {row.channel for row in single} == {"L1"}


def test_unknown_quantities_are_null_never_nan():
    mains = make_mains(50.0, seconds=0.4, phases=1)
    mains.codes[:] = 0
    batch = Meter(StreamFormat(20_000.0, mains.scale)).feed(SampleBlock(mains.codes, 0, 0))
    for row in rows_of(batch, "d", "b"):
        plain = json.loads(row.to_json())
        assert plain["f"] is None and plain["PF"] is None and plain["Vrms"] == 0.0
        assert b"NaN" not in row.to_json() and "no_mains" in plain["flags"]


_value = st.none() | st.floats(-1e9, 1e9)


@given(
    seq=st.integers(0, 2**62), values=st.lists(_value, min_size=7, max_size=7), channel=st.sampled_from(CHANNELS),
    flags=st.lists(st.sampled_from(["gap", "late", "overrange"]), unique=True),
)  # fmt: skip
def test_rows_survive_the_wire(seq, values, channel, flags):
    row = PowerRow("d", channel, "b", seq, "2021-07-13T08:15:30.123456Z", 5, *values, flags)
    assert parse_row(row.to_json()) == row


@pytest.mark.parametrize(
    ("change", "complaint"),
    [({"P": "12"}, "P"), ({"seq": -1}, "seq"), ({"seq": 1.5}, "seq"), ({"channel": "L4"}, "channel"),
     ({"time": "yesterday"}, "time"), ({"time": "2021-13-45T00:00:00Z"}, "RFC 3339"), ({"device": ""}, "device"),
     ({"flags": None}, "flags"), ({"schema": 2}, "schema"), ({"boot": None}, "boot"),
     ({"filetime": 2**70}, "filetime|int")],
)  # fmt: skip
def test_malformed_rows_are_refused_with_the_field(change, complaint):
    _, _, rows = some_rows(phases=1)
    plain = json.loads(rows[0].to_json()) | change
    with pytest.raises(ValueError, match=complaint):
        parse_row(json.dumps(plain).encode())


def test_deep_nesting_and_absurd_numbers_are_refused():
    _, _, rows = some_rows(phases=1)
    text = rows[0].to_json()
    for bad in (
        text[:-1] + b',"x":' + b"[" * 100_000 + b"]" * 100_000 + b"}",
        text.replace(b'"S":', b'"S":1e200,"SS":'),
    ):
        with pytest.raises(ValueError):
            parse_row(bad)


_good = PowerRow("d", "L1", "b", 1, "2021-07-13T08:15:30.123456Z", 5, *[1.5] * 7, []).to_json()
_payload = st.binary(max_size=20) | st.sampled_from(
    [_good, _good + _good, _good[:40], _good[40:], _good.replace(b"Z", b""), _good.replace(b"15:30", b"15:31"),
     _good.replace(b'"b"', b'"\\u0000"'), _good.replace(b'"b"', b'"u0000"'), _good[:-1] + b',"x":"\\', b'u0000"}']
)  # fmt: skip


@given(st.lists(_payload, max_size=8))
def test_rows_parsed_together_are_those_parsed_one_by_one(payloads):
    """What is wrong with one changes nothing for the next one, and halves of two are no whole."""
    for payload, together in zip(payloads, parse_each(payloads), strict=True):
        try:
            alone: PowerRow | ValueError = parse_row(payload)
        except ValueError as error:
            alone = error
        assert str(together) == str(alone) and type(together) is type(alone)


@given(st.binary(max_size=60))
def test_any_bytes_are_refused_without_a_crash(payload):
    with pytest.raises(ValueError):
        parse_row(payload)
