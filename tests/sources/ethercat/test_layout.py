"""The process data of a terminal."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from acqd.errors import UserError
from acqd.sources.ethercat import objects
from acqd.sources.ethercat.assemble import Assembler
from acqd.sources.ethercat.layout import Block, build_layout
from acqd.sources.ethercat.sample_count import SampleCount
from acqd.sources.ethercat.settings import EthercatSettings


def mapping(pdo: int, oversampling: int = 20, next_sync1_bits: int = 64, other_bits: int = 16) -> list[int]:
    if pdo == objects.NEXT_SYNC1_PDO:
        return [0x6060_0100 | next_sync1_bits]
    if pdo in (objects.SAMPLE_COUNT_PDO, objects.RANGE_PDO):
        return [0x6061_0100 | other_bits]
    if pdo & 0x0F == 0:
        return [0x6000_0110]
    return [0x6002_0010 | k << 8 for k in range(1, oversampling + 1)]


@pytest.mark.parametrize(("bits", "size"), [(64, 264), (32, 260)])
def test_the_layout_follows_the_mapping_that_the_terminal_reports(bits, size):
    layout = build_layout(objects.assignment(7), lambda pdo: mapping(pdo, next_sync1_bits=bits))
    assert layout.size == size and layout.next_sync1 == (252, bits // 8) and layout.oversampling == 20
    image = bytearray(size)
    image[layout.samples[5] : layout.samples[5] + 2] = (-2).to_bytes(2, "little", signed=True)
    image[252:256] = (7).to_bytes(4, "little")
    block = layout.decode(bytes(image), 3)
    assert block.samples[5, 0] == -2 and block.next_sync1_ns == 7 and block.samples.shape == (6, 20)
    if bits == 32:  # the low half of a time that has left 32 bits long ago
        image[252:256] = (5).to_bytes(4, "little")
        assert layout.decode(bytes(image), (9 << 32) - 100).next_sync1_ns == (9 << 32) + 5
        assert layout.decode(bytes(image), (9 << 32) + 100).next_sync1_ns == (9 << 32) + 5


def test_a_mapping_that_lacks_a_part_is_refused():
    for missing in (objects.NEXT_SYNC1_PDO, objects.STATUS_PDO, objects.SAMPLES_PDO + 7):
        assigned = [pdo for pdo in objects.assignment(7) if pdo != missing]
        with pytest.raises(UserError, match="EL3783"):
            build_layout(assigned, mapping)


@pytest.mark.parametrize(("bits", "size"), [(8, 262), (16, 264), (32, 268)])
def test_widths_of_count_and_range_follow_the_mapping(bits, size):
    layout = build_layout(objects.assignment(7), lambda pdo: mapping(pdo, other_bits=bits))
    assert layout.size == size and layout.count == (260, bits // 8)
    image = bytearray(size)
    at, width = layout.fine_range
    image[at : at + width] = (5).to_bytes(width, "little")
    image[260 : 260 + width] = (200).to_bytes(width, "little")
    block = layout.decode(bytes(image), 3)
    assert (block.fine_range, block.count) == (5, 200)


def blocks(count, step, width=2, samples=20):
    made = []
    for k in range(count):
        codes = np.zeros((6, samples), np.int16)
        made.append(
            Block(codes, (k + 1) * 1_000_000, (65_530 + k * step) % (1 << 8 * width), np.zeros(6, np.uint16), 0)
        )
    return made


@pytest.mark.parametrize("step", [1, 20])
@pytest.mark.parametrize("width", [1, 2, 4])
def test_a_sample_count_of_blocks_or_samples_is_recognised_and_then_held_to(step, width):
    assembler = Assembler(EthercatSettings("x"), 1_000_000, 20, width)
    flags = [assembler.add([block])[0].flags for block in blocks(30, step, width)]
    assert not any(flags)
    late = Block(np.zeros((6, 20), np.int16), 31_000_000, 12_345 % (1 << 8 * width), np.zeros(6, np.uint16), 0)
    assert assembler.add([late])[0].flags == {"sync_error"}


@pytest.mark.parametrize("step", [1, 20])
def test_a_count_that_begins_late_is_learnt_then_and_one_that_never_rises_says_nothing(step):
    known = SampleCount(20, 2)
    assert not any(known.contradicts(7, 1) for _ in range(5)), "it stands still"
    assert not any(known.contradicts(7 + k * step, 1) for k in range(1, 5))
    assert not known.contradicts(7 + 6 * step, 2), "a block was lost"
    assert known.contradicts(7 + 6 * step, 1) and known.contradicts(7 + 6 * step + 3, 1)
    assert not known.contradicts(7 + 7 * step + 3, 1)


def test_terminals_that_count_differently_are_each_held_to_their_count():
    settings = EthercatSettings("x", terminals=2, phases=("1:L1", "2:L1"))
    assembler = Assembler(settings, 1_000_000, 20, 2)
    pairs = list(zip(blocks(10, 1), blocks(10, 20), strict=True))
    assert not any(assembler.add(list(pair))[0].flags for pair in pairs[:8])
    one, other = pairs[9]
    assert assembler.add([replace(one, next_sync1_ns=9_000_000), replace(other, next_sync1_ns=9_000_000)])[0].flags == {
        "sync_error"
    }
