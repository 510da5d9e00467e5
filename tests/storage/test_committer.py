"""The thread that commits, with a database that refuses for a while."""

from __future__ import annotations

import errno
import sqlite3

import pytest
import sqlalchemy as sa

from acqd.retry import Backoff, RetryPolicy
from acqd.storage import committer as module
from acqd.storage.committer import Batch, Committer
from acqd.storage.database import engine_for, prepare
from tests.storage.rows import count, message, row
from tests.waiting import wait_for


@pytest.fixture
def engine(tmp_path):
    engine = engine_for(str(tmp_path / "a.sqlite"), impatient=True)
    prepare(engine)
    return engine


def collect(committer, batches):
    done = []
    wait_for(lambda: done.extend(committer.done()) or len(done) == batches, "the batches are committed")
    return done


def test_batches_are_committed_in_order_and_returned_with_receipts(engine):
    committer = Committer(engine)
    for k in range(3):
        committer.submit(Batch([message(row(k))], [k + 1], 0, 0.0))
    done = collect(committer, 3)
    assert [batch.numbers for batch, _ in done] == [[1], [2], [3]] and committer.room
    assert [list(*written.receipts.values()) for _, written in done] == [[(0, 0)], [(1, 1)], [(2, 2)]]
    committer.close(5)


def test_a_database_that_is_away_is_said_once_and_tried_again(engine, caplog, monkeypatch):
    monkeypatch.setattr(module, "Backoff", lambda: Backoff(RetryPolicy(0.01, 0.02)))
    committer = Committer(engine)
    refusals = iter(range(5))
    write = committer._writer.write

    def refusing(messages):
        if next(refusals, None) is not None:
            raise sa.exc.OperationalError("INSERT", None, sqlite3.OperationalError("database is locked"))
        return write(messages)

    committer._writer.write = refusing
    committer.submit(Batch([message(row(0))], [1], 0, 0.0))
    collect(committer, 1)
    assert count(engine) == 1 and not committer.trouble
    assert caplog.text.count("database is locked") == 1 and caplog.text.count("takes rows again") == 1
    committer.close(5)


def test_an_error_of_the_disk_is_no_end_either(engine, caplog, monkeypatch):
    """Whatever call meets it: the sink goes on, and names the file."""
    monkeypatch.setattr(module, "Backoff", lambda: Backoff(RetryPolicy(0.01, 0.02)))
    committer, refusals = Committer(engine), [OSError(errno.EINVAL, "Invalid argument")] * 2
    write = committer._writer.write

    def refusing(messages):
        if refusals:
            raise refusals.pop()
        return write(messages)

    committer._writer.write = refusing
    committer.submit(Batch([message(row(0))], [1], 0, 0.0))
    collect(committer, 1)
    assert count(engine) == 1 and not committer.trouble
    assert "a.sqlite: Invalid argument; rows wait" in caplog.text
    committer.close(5)


def test_a_bug_is_not_hidden(engine):
    committer = Committer(engine)
    committer._writer.write = lambda messages: 1 / 0
    committer.submit(Batch([message(row(0))], [1], 0, 0.0))
    with pytest.raises(ZeroDivisionError):
        collect(committer, 1)
    committer.close(5)


def test_closing_does_not_wait_for_a_database_that_is_away(engine):
    committer = Committer(engine)

    def away(messages):
        raise sa.exc.OperationalError("INSERT", None, sqlite3.OperationalError("away"))

    committer._writer.write = away
    committer.submit(Batch([message(row(0))], [1], 0, 0.0))
    wait_for(lambda: committer.trouble, "the trouble is noticed")
    committer.close(30)
    assert not committer._thread.is_alive()
