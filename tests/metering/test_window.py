"""Batches of windows."""

import pickle

import pytest

from acqd.metering.window import OneWindow, batch_of, windows_of


def one(flags=None):
    return batch_of(
        OneWindow(7, 10**18, 50.01, [230.0, 231.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0], [9.0, 8.0, 0.5, 0.25], flags)
    )


def test_columns_of_one_window_are_made_when_somebody_reads_one():
    batch = one()
    assert len(batch) == 1 and batch.seq.tolist() == [7] and batch.utc_ns.tolist() == [10**18]
    assert batch.Vrms.tolist() == [[230.0], [231.0]] and batch.Q1.tolist() == [[5.0], [6.0]]
    assert (
        batch.W.tolist() == [[8.5], [7.75]] and batch.S.tolist() == [[230.0], [462.0]] and batch.f.tolist() == [50.01]
    )
    assert batch.flags == [[set()], [set()]] and batch.flags[0][0] is not batch.flags[1][0]
    assert one([[{"late"}], [set()]]).flags == [[{"late"}], [set()]]
    with pytest.raises(AttributeError, match="no 'volts'"):
        _ = one().volts


def test_it_is_changed_and_sent_like_any_other():
    assert one().renumbered(3).seq.tolist() == [10]
    assert pickle.loads(pickle.dumps(one())).P.tolist() == [[3.0], [4.0]]
    batch = one()
    batch.imported[0] += 1.0
    assert batch.imported.tolist() == [[10.0], [8.0]]


@pytest.mark.parametrize("flags", [None, [[{"late"}], [set()]]])
def test_windows_one_by_one_are_the_same_whether_columns_have_been_made_or_not(flags):
    batch = one(flags)
    (plain,) = windows_of(batch)
    assert len(batch) == 1 and batch.P.tolist() == [[3.0], [4.0]]
    (made,) = windows_of(batch)
    assert made == plain and made is not plain
    batch.imported[0] += 1.0
    assert windows_of(batch)[0].readings == [10.0, 8.0, 0.5, 0.25]
    assert [each.seq for each in windows_of(type(batch).join([batch, one().renumbered(1)]))] == [7, 8]
