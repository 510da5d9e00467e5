""""""

from datetime import UTC, datetime
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from acqd.errors import InputError
from acqd.timestamps import filetime, parse_times, rfc3339


def test_times_keep_their_nanoseconds():
    stamps = parse_times(Path("x"), "time", ["2021-07-13T08:00:00.123456+02:00", "2021-07-13T06:00:00.123456Z"])
    assert stamps[0] == stamps[1] == 1_626_156_000_123_456_000
    with pytest.raises(InputError, match="is not a Unix time"):
        parse_times(Path("x"), "time", [1e25])


@given(st.integers(0, 4 * 10**18))
def test_both_time_stamps_tell_the_same_time(utc_ns):
    stamp = datetime.fromisoformat(rfc3339(utc_ns))
    micros = (stamp - datetime(1970, 1, 1, tzinfo=UTC)) // (datetime.resolution)
    assert micros == utc_ns // 1000
    assert (filetime(utc_ns) - 116_444_736_000_000_000) // 10 == micros
