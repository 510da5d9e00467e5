"""From blocks to files and back: the same blocks, the same rows, every gap named."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from acqd.archive.catalogue import contents
from acqd.archive.coding import decode, encode
from acqd.archive.verify import verified
from acqd.daemon.archive.compare import Comparison
from acqd.daemon.archive.replay import chosen, remade
from acqd.daemon.archive.rows import remake
from acqd.daemon.config import Config
from acqd.daemon.source_sections import SimulatedSection
from acqd.errors import UserError
from acqd.metering import SampleBlock
from acqd.metering.block import StreamFormat
from acqd.telemetry.row import json_lines
from tests.archive.box import FORM, RATE, UTC, FakeBox, mains, recorder

CODES = mains(3.0)


def again(folder, device="box", begin=None, end=None, stored=()):
    """Rows that the archive gives, through the path of `acqd replay --archive`."""
    comparison = Comparison.of(stored)
    return remade(chosen(folder, device, begin, end), begin, end, lambda tasks: map(remake, tasks), None, comparison)


def kept(folder, device="box"):
    """All blocks in the archive."""
    return [block for segment in contents(folder, device).segments for block in segment.blocks()]


def equal(one: SampleBlock, other: SampleBlock) -> bool:
    told = [(b.index, b.utc_ns, b.lost, b.flags, b.codes.dtype) for b in (one, other)]
    return told[0] == told[1] and np.array_equal(one.codes, other.codes)


@pytest.fixture(scope="module")
def disturbed(tmp_path_factory):
    """A box with gaps, steps of the clock, ragged blocks, flags, a boot that changes, and its archive."""
    root = tmp_path_factory.mktemp("archive")
    archive, rng = recorder(root), np.random.default_rng(2)
    box, at, utc, lost = FakeBox(archive), 123, UTC, 0
    for number in range(90):
        blocks = []
        for _ in range(int(rng.integers(1, 3))):
            count = int(rng.choice((800, 800, 800, 350, 1)))
            flags = frozenset({"late"}) if rng.random() < 0.05 else frozenset()
            if number == 40 or number == 60:
                flags, utc = flags | {"clock_step"}, utc + (-15 * 10**9 if number == 60 else 777)
            codes = CODES[at % 40_000 : at % 40_000 + count]
            blocks.append(SampleBlock(codes, at, utc + at * 50_000, lost, flags))
            lost = int(rng.integers(1, 2000)) if rng.random() < 0.06 else 0
            at += count + lost
        box.cycle(blocks)
    box.track.finish()
    archive.close()
    return root, box


def test_blocks_come_back_as_they_were(disturbed):
    root, box = disturbed
    back = kept(root)
    assert len(contents(root).segments) > 3
    assert len(back) == len(box.blocks) and all(map(equal, back, box.blocks))
    assert all(not verified(segment).faults for segment in contents(root).segments)


def test_rows_are_the_same_to_the_last_bit_with_gaps_flags_and_boots(disturbed):
    root, box = disturbed
    report = again(root, stored=box.rows)
    assert (report.comparison.same, report.comparison.different, report.comparison.not_stored) == (len(box.rows), 0, 0)
    assert not report.comparison.stored and not report.notes
    assert report.joints == report.segments - 1
    assert len({row.boot for row in box.rows}) > 1, "the clock that was set back begins another boot"
    flags = {flag for row in box.rows for flag in row.flags}
    assert {"gap", "late", "clock_step"} <= flags


def test_a_range_has_the_rows_that_begin_in_it(disturbed):
    root, box = disturbed
    times = sorted(row.filetime for row in box.rows)
    begin, end = ((times[len(times) * k // 5] - 116_444_736_000_000_000) * 100 for k in (2, 3))
    wanted = [row for row in box.rows if begin <= (row.filetime - 116_444_736_000_000_000) * 100 < end]
    report = again(root, begin=begin, end=end, stored=wanted)
    assert report.rows == report.comparison.same == len(wanted) > 10


def test_every_gap_of_the_source_is_named(disturbed):
    root, box = disturbed
    missing = [(b.index - a.index - len(a.codes)) for a, b in zip(box.blocks, box.blocks[1:], strict=False)]
    gaps = contents(root).gaps()
    assert [gap.samples for gap in gaps] == [count for count in missing if count]
    assert {gap.why for gap in gaps} == {"the source sent none"}


def test_a_changed_number_is_a_difference(disturbed):
    root, box = disturbed
    wrong = replace(box.rows[7], W=np.nextafter(box.rows[7].W, 1.0))
    report = again(root, stored=[*box.rows[:7], wrong, *box.rows[8:-1]])
    found = report.comparison
    assert (found.different, found.not_stored, found.same) == (1, 1, len(box.rows) - 2)
    assert "W" in found.examples[0]


def test_corrections_derived_phases_and_wide_codes(tmp_path):
    """Stages have a state, too; and 32-bit codes another coding."""
    archive = recorder(tmp_path)
    source = SimulatedSection(wiring="aron", correction={"u_gain": [1.01, -1.0], "i_delay_us": [30.0]})
    config = Config(device="aron", source=source)
    box = FakeBox(archive, config, StreamFormat(RATE, (0.02, 0.0003) * 2))
    box.feed(CODES[:30_000, :4], at=5)
    wide = FakeBox(archive, Config(device="wide"), StreamFormat(RATE, (2e-5, 3e-7) * 3, bits=32))
    wide.feed(CODES[:30_000].astype(np.int32) * 1000)
    for each in (box, wide):
        each.track.finish()
    archive.close()
    for each in (box, wide):
        report = again(tmp_path, each.config.device, stored=each.rows)
        assert report.comparison.same == len(each.rows) == report.rows and report.joints > 0
    with pytest.raises(UserError, match="aron, wide; choose one"):
        chosen(tmp_path, None, None, None)


def test_another_start_is_a_gap_with_a_name(tmp_path):
    for number, begin in enumerate((0, 100_000)):
        archive = recorder(tmp_path)
        box = FakeBox(archive, boot=f"b{number}")
        box.feed(CODES[:4000], utc=UTC + begin * 50_000)
        box.track.finish()
        archive.close()
    (gap,) = contents(tmp_path).gaps()
    assert gap.why == "acqd was stopped" and gap.samples is None
    assert gap.end_ns - gap.begin_ns == 96_000 * 50_000


def test_two_daemons_do_not_share_a_folder(tmp_path):
    archive = recorder(tmp_path)
    with pytest.raises(UserError, match="in use by another acqd"):
        recorder(tmp_path)
    archive.close()


def test_other_arithmetic_is_said(disturbed, monkeypatch):
    root, box = disturbed
    monkeypatch.setattr("acqd.metering.meter.why_not", lambda _: "test")
    report = again(root, stored=box.rows)
    assert any("was metered by" in note and "'numpy' now" in note for note in report.notes)
    assert report.comparison.same + report.comparison.different == len(box.rows)


@settings(max_examples=40, deadline=None)
@given(st.data())
def test_any_codes_come_back(data):
    kind = data.draw(st.sampled_from(("<i2", "<i4", "<f8")))
    samples, channels = data.draw(st.integers(1, 60)), data.draw(st.sampled_from((2, 4, 6)))
    seed, size = data.draw(st.integers(0, 99)), data.draw(st.sampled_from((1, 200, 2**15 - 1, 2**23 - 1, 2**26)))
    rng = np.random.default_rng(seed)
    values = rng.integers(-size - 1, size + 1, (samples, channels))
    codes = np.clip(values, -32768, 32767).astype(kind) if kind == "<i2" else (values * 1.0).astype(kind)
    coding, content = encode(codes)
    back = decode(coding, content, codes.dtype, samples, channels)
    assert np.array_equal(back, codes) and back.dtype == codes.dtype


def test_flac_is_smaller_than_half_of_noisy_mains():
    coding, content = encode(CODES[:8000])
    assert coding == "flac16" and len(content) < 0.5 * CODES[:8000].nbytes
    assert encode(np.full((8, 2), 2**25, np.int32))[0] == "sorted"
    with pytest.raises(ValueError, match="flac16"):
        decode(coding, content[:500], np.dtype(np.int16), 8000, 6)


def test_rows_are_json_lines_in_order(disturbed):
    import io

    root, box = disturbed
    out = io.BytesIO()
    remade(chosen(root, None, None, None), None, None, lambda tasks: map(remake, list(reversed(tasks))), out)
    assert out.getvalue() == json_lines(box.rows)
    assert json.loads(out.getvalue().splitlines()[0])["device"] == "box"
    assert FORM.phases == 3
