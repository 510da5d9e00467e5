"""Replaying a waveform."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.sources import ChannelMap, ReplaySource
from acqd.sources.spec import make_source, replay_spec
from tests.mains import make_mains
from tests.sources.files import write_csv


@settings(max_examples=20)
@given(reads=st.lists(st.integers(0, 3_000), min_size=1, max_size=10), loops=st.integers(1, 4))
def test_replay_plays_every_sample_once_per_loop(reads, loops):
    codes = np.arange(5_000, dtype=np.int16).reshape(-1, 2)
    mains = make_mains(50.0, seconds=0.2, phases=1)
    mains.codes = codes
    from acqd.metering import StreamFormat
    from acqd.sources.waveform import Waveform

    source = ReplaySource(Waveform("w", codes, StreamFormat(20_000.0, mains.scale), 7), loops)
    source.open(99, index=40)
    parts, index = [], 40
    for limit in [*reads, *[10_000] * 5]:
        block = source.read(limit)
        if block is None:
            break
        assert block.index == index and block.utc_ns == 7 + (index - 40) * 50_000
        index += len(block.codes)
        parts.append(block.codes)
    np.testing.assert_array_equal(np.concatenate(parts), np.tile(codes, (loops, 1)))


def test_a_replay_spec_survives_the_way_to_another_process(tmp_path):
    import json

    write_csv(tmp_path / "a.csv")
    spec = json.loads(json.dumps(replay_spec(tmp_path / "a.csv", ChannelMap(), 2)))
    source = make_source(spec)
    source.open(0)
    assert len(source.read(100_000).codes) == 8_000 and source.read(1) is None
