"""Files that must not stop the sidecar, fill its memory, or be published: huge, linked, of somebody else."""

import hashlib
import json
import os
from pathlib import Path

import pytest

from acqd.errors import InputError
from acqd.sidecar.log_folder import LogFolder
from acqd.storage.database import open_database
from tests.sidecar.cell import BEGIN, cell, motion, store_power, write_log
from tests.sidecar.runs import counts_of, done_in, run, sidecar

HUGE = 10 * 1024**3


@pytest.fixture
def logs(tmp_path):
    (tmp_path / "logs").mkdir()
    return tmp_path / "logs"


def sparse(path, size=HUGE):
    with path.open("wb") as file:
        file.truncate(size)


def test_a_huge_sparse_file_is_refused_without_reading_it_and_the_good_logs_are_done(tmp_path, bundle, logs):
    url = str(tmp_path / "p.sqlite")
    open_database(url)
    cell(logs, url, 2)
    sparse(logs / "a_huge.log")
    os.utime(logs / "a_huge.log", (1, 1))  # old: it is not waited for
    command = sidecar(logs, bundle, url, "--no-mqtt", "--until-idle", "--json")
    result = run(command)
    assert counts_of(result) == {"done": 2, "refused": 1, "waiting": 0}, result.stderr
    assert sum("a_huge.log" in line for line in result.stderr.splitlines()) == 1
    reason = done_in(url)[0]["a_huge.log"][1]["reason"]
    assert "a_huge.log: is 10.7 GB; a log of at most 2.1 GB is expected" in reason
    assert counts_of(run(command))["refused"] == 0  # known, although it was never read


def test_a_large_file_without_lines_is_refused_after_one_block(tmp_path, bundle, logs):
    url = str(tmp_path / "p.sqlite")
    open_database(url)
    cell(logs, url, 1)
    sparse(logs / "a.log", 50_000_000)
    os.utime(logs / "a.log", (1, 1))
    result = run(sidecar(logs, bundle, url, "--no-mqtt", "--until-idle", "--json"))
    assert counts_of(result) == {"done": 1, "refused": 1, "waiting": 0}
    assert "line of more than 65536 bytes" in done_in(url)[0]["a.log"][1]["reason"]


def test_links_are_never_followed(tmp_path, bundle, logs):
    url, secret = str(tmp_path / "p.sqlite"), tmp_path / "secret.txt"
    open_database(url)
    cell(logs, url, 1)
    secret.write_text("root:$6$hash,of,a,password\n1,2,3,4\n")
    (logs / "link.log").symlink_to(secret)
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "b.log").write_text(secret.read_text())
    (logs / "sub").symlink_to(tmp_path / "elsewhere")
    result = run(sidecar(logs, bundle, url, "--no-mqtt", "--until-idle", "--json"))
    assert counts_of(result) == {"done": 1, "refused": 0, "waiting": 0}
    assert list(done_in(url)[0]) == ["log_000.csv"]
    assert "hash" not in result.stdout + result.stderr
    assert sum("link.log: is a link" in line for line in result.stderr.splitlines()) == 1


@pytest.mark.parametrize("swapped", ["file", "folder"])
def test_a_file_that_becomes_a_link_after_it_was_seen_is_not_opened(tmp_path, logs, swapped):
    secret = tmp_path / "other"
    secret.mkdir()
    (secret / "a.log").write_text("secret\n")
    (logs / "sub").mkdir()
    path = logs / "sub" / "a.log"
    if swapped == "file":
        path.symlink_to(secret / "a.log")
    else:
        (logs / "sub").rmdir()
        (logs / "sub").symlink_to(secret)
    with pytest.raises(OSError, match=r"symbolic links|directory"), LogFolder(logs).open(path):
        pass


def test_a_pipe_does_not_block_and_is_not_read(logs):
    os.mkfifo(logs / "p.log")
    with pytest.raises(InputError, match="is no plain file"), LogFolder(logs).open(logs / "p.log"):
        pass


@pytest.mark.parametrize(
    "content",
    [
        "password=hunter2\n",
        "hunter2,hunter2\n1,2\n",
        "time,q1,q2,q3,q4,q5,q6,hunter2\n" + "1,2,3,4,5,6,7,hunter2\n" * 80,
        "time,q1,q2,q3,q4,q5,q6\nhunter2,1,2,3,4,5,6\n",
        "hunter2;" * 50 + "\n" + "1;" * 3 + "\n",
        "\x00hunter2\n",
    ],
)
def test_a_reason_quotes_nothing_of_the_file(tmp_path, bundle, logs, content):
    url = str(tmp_path / "p.sqlite")
    open_database(url)
    (logs / "a.log").write_text(content)
    result = run(sidecar(logs, bundle, url, "--no-mqtt", "--until-idle", "--json"))
    assert counts_of(result)["refused"] == 1
    assert "hunter2" not in result.stdout + result.stderr + json.dumps(done_in(url))


def test_an_unforeseen_error_is_published_by_its_type_only(tmp_path, bundle, logs, monkeypatch):
    url = str(tmp_path / "p.sqlite")
    open_database(url)
    cell(logs, url, 1)

    def fails(*_):
        raise KeyError("hunter2")

    monkeypatch.setattr("acqd.sidecar.worker.open_log", fails)
    result = run(sidecar(logs, bundle, url, "--no-mqtt", "--until-idle", "--json"))
    assert "KeyError" in result.stdout and "hunter2" not in result.stdout


def test_one_row_far_in_the_future_does_not_make_late_logs_refused(tmp_path, bundle, logs):
    url = str(tmp_path / "p.sqlite")
    engine = open_database(url)
    store_power(url, [100.0], BEGIN - 1e6, first=5_000_000)
    with engine.begin() as connection:
        connection.exec_driver_sql(
            "INSERT INTO power SELECT device, channel, boot, seq + 1, time, 9000000000000000000,"
            ' "Vrms", "Irms", "P", "S", "PF", f, "W", flags, schema FROM power'
        )
    write_log(logs / "log_000.csv", motion(800, 0), BEGIN)
    command = sidecar(logs, bundle, url, "--no-mqtt", "--until-idle", "--json", "--patience", "0")
    assert counts_of(run(command)) == {"done": 0, "refused": 0, "waiting": 1}  # late, not refused
    cell(logs, url, 1)
    assert counts_of(run(command))["done"] == 1


def test_a_log_is_hashed_in_blocks(logs):
    path: Path = logs / "a.log"
    path.write_bytes(b"x" * 3_000_000)
    folder = LogFolder(logs)
    assert folder.identity(path)[0] == hashlib.sha256(path.read_bytes()).hexdigest()
