"""Training, validation and test."""

import numpy as np

from acqd.dataset.split import log_name, source_of, sources_of, split


def test_no_source_is_on_two_sides_and_shares_are_kept():
    sources = {f"limited_{k:02d}": 200.0 + k for k in range(46)} | {f"all_{k:02d}": 320.0 for k in range(30)}
    parts = split(sources, 1)
    for kind, total in (("limited", 46), ("all", 30)):
        counts = [
            sum(part == side and name.startswith(kind) for name, part in parts.items())
            for side in ("train", "validation", "test")
        ]
        assert sum(counts) == total
        np.testing.assert_allclose(np.array(counts) / total, [0.74, 0.12, 0.14], atol=0.06)
    assert split(sources, 1) == parts != split(sources, 2)
    assert source_of("limited_07_0123") == "limited_07" and source_of("run1") == "run1"


def test_one_log_cut_into_pieces_is_split_by_its_pieces_many_by_their_source():
    assert len(set(sources_of([f"run_p{k:03d}" for k in range(9)]).values())) == 9
    many = [f"all_{k:02d}_{n:04d}_p{p:03d}" for k in range(3) for n in range(4) for p in range(5)]
    assert set(sources_of(many).values()) == {"all_00", "all_01", "all_02"}


def test_numbered_logs_are_sources_when_they_would_be_one_trajectory():
    names = [f"rec_{k:04d}" for k in range(1, 8)]
    sources = sources_of(names)
    assert sources == {name: name for name in names}
    parts = split(dict.fromkeys(sources.values(), 60.0), 1)
    assert set(parts.values()) == {"train", "validation", "test"}
    pieces = [f"{name}_p{p:03d}" for name in names for p in range(1, 4)]
    assert set(sources_of(pieces).values()) == set(names)  # pieces of one log stay together
    two = [f"rec_{k:04d}_p{p:03d}" for k in (1, 2) for p in range(1, 4)]
    assert sources_of(two) == {name: name for name in two}


def test_a_log_has_more_than_a_thousand_pieces():
    assert {log_name(f"shift_p{number:03d}") for number in (1, 999, 1000, 12345)} == {"shift"}
    assert log_name("shift_p01") == "shift_p01"
