"""Files that visitors drop on the page: safe names, limits, one visit at a time, results complete or not there."""

from __future__ import annotations

import asyncio
import ctypes
import json
import os
import time
import unittest.mock
from pathlib import Path
from types import SimpleNamespace

import orjson
import pytest

from acqd.cli.errand import give_way
from acqd.cli.web import without_work
from acqd.daemon.health.section import HealthSection
from acqd.daemon.web_section import WebSection
from acqd.errors import UserError
from acqd.robot.description import load_description
from acqd.telemetry.mqtt import BrokerAddress
from acqd.web import dropped as dropping
from acqd.web.commands import Commands as RealCommands
from acqd.web.commands import password_of, without_password
from acqd.web.dropped import Dropped
from acqd.web.files import Files
from acqd.web.files_routes import FilesRoutes
from acqd.web.job import LoopJob
from acqd.web.kept_results import remove_oldest
from acqd.web.recognition import figures_of, kind_of
from acqd.web.reports import newest_report
from acqd.web.settings import WebSettings
from acqd.web.work_folder import WorkFolder, remove_left
from tests.waiting import finish, until
from tests.web.test_proxy import status

Starlette = pytest.importorskip("starlette.applications").Starlette
LOG = b"time,q1,q2,q3,q4,q5,q6,q7\n" + b"".join(b"%d,0,0,0,0,0,0,0\n" % k for k in range(5))
ROWS = b"time,P\n2026-01-01T00:00:00Z,5.0\n"


def settings_of(reports, **more):
    section = WebSection(reports=reports, files=True, robot="iiwa7_r800", **more)
    return WebSettings(
        BrokerAddress("127.0.0.1", 1), "none.sqlite", HealthSection(port=0, sink_port=0), section=section
    )


async def body(*pieces):
    for piece in pieces:
        yield piece


class Commands:
    """A double of what runs commands: `fails` names one that refuses its input."""

    def __init__(self, fails="", hangs=False):
        self.ran, self.fails, self.hangs = [], fails, hangs

    async def run(self, arguments, told, secrets=None):
        told("half", 0.5)
        self.ran.append(arguments)
        if self.hangs:
            await asyncio.sleep(60)
        if arguments[0] == self.fails:
            raise UserError(f"{arguments[3]}: row 2 is bad")
        if "--inspect" in arguments:
            if not arguments[2].endswith(".wav"):
                raise UserError("unknown kind of waveform file")
            return orjson.dumps({"refusal": "", "samples": 8000, "rate": 4000.0})
        out = Path(arguments[arguments.index("--out") + 1])
        if "--logs" in arguments:
            self.logs = sorted(path.name for path in Path(arguments[arguments.index("--logs") + 1]).iterdir())
        if arguments[0] == "replay":
            out.write_bytes(b'{"channel": "L1", "P": 4.0, "W": 0.001}\n{"channel": "L1", "P": 6.0, "W": 0.002}\n')
        else:
            out.mkdir()
            (out / "report.html").write_text("report")
        return b""


def worked(files, commands, *given):
    """The state after a visit with files of these names and contents."""

    async def scenario():
        files._commands = commands
        for name, content in given:
            await files.take(name, body(content))
        files.start()
        await until(lambda: not files.running or (commands.hangs and commands.ran), "the end of the work")
        if commands.hangs:
            await files.cancel()

    finish(scenario())
    return files.as_json()


def test_names_are_made_safe_and_a_refused_file_leaves_nothing(tmp_path):
    dropped = Dropped(tmp_path / "in", 10)

    def take(name, *pieces):
        return asyncio.run(dropped.take(name, body(*pieces)))

    assert take("../../etc/pass wd", b"12345") == "pass_wd.csv"
    assert take("C:\\logs\\.hidden.csv", b"1") == "hidden.csv"
    for name, pieces, words in (
        ("big.csv", (b"123", b"45"), "more than 0 MB in all"), ("pass wd", (b"1",), "already"),
        ("..", (b"1",), "a name"),
        ("empty.csv", (), "empty"), ("\0\n", (b"1",), "a name"),
    ):  # fmt: skip
        with pytest.raises(UserError, match=words):
            take(name, *pieces)
    assert sorted(path.name for path in tmp_path.rglob("*") if path.is_file()) == ["hidden.csv", "pass_wd.csv"]


def test_logs_are_built_and_searched_and_only_complete_results_stay(tmp_path):
    (tmp_path / ".files-20200101T000000Z").mkdir()  # of a page that was killed
    files, commands = Files(settings_of(tmp_path, model=tmp_path)), Commands()
    assert not list(tmp_path.iterdir())
    state = worked(files, commands, ("a.csv", LOG), ("rows.csv", ROWS), ("mains.wav", b"RIFF\0"), ("x.bin", b"\0\1"))
    assert [each["kind"] for each in state["files"]] == ["log", "power", "waveform", "unknown"]
    assert state["files"][2]["says"] == "2 s metered: mean power 5 W, 2 Wh"
    assert state["state"] == "done" and state["pages"] == ["dataset", "result"]
    build, loop = commands.ran[-2:]
    assert build[:2] == ["dataset", "build"] and build[build.index("--power") + 1].endswith("/in/rows.csv")
    assert loop[0] == "close-loop"
    assert sorted(path.name for path in (tmp_path / state["folder"]).iterdir()) == ["dataset", "result"]


def test_results_are_bounded_by_number_and_size_the_oldest_first(tmp_path):
    for k in range(1, 6):
        folder = tmp_path / f"files-2026010{k}T000000Z" / "dataset"
        folder.mkdir(parents=True)
        (folder / "report.html").write_bytes(b"x" * 1000)
    (tmp_path / "payload.loop").mkdir()  # a result of acqd close-loop
    (tmp_path / "files-20250101T000000Z").symlink_to(tmp_path / "payload.loop")
    kept = lambda: sorted(path.name[6:14] for path in tmp_path.glob("files-2026*"))  # noqa: E731
    assert remove_oldest(tmp_path, 5, 1e9) == [] == remove_oldest(tmp_path / "nosuch", 1, 1)
    assert remove_oldest(tmp_path, 4, 1e9) == ["files-20260101T000000Z"]
    size = sum(path.lstat().st_size for path in (tmp_path / "files-20260105T000000Z").rglob("*"))
    assert len(remove_oldest(tmp_path, 50, 2.5 * size)) == 2 and kept() == ["20260104", "20260105"]
    assert len(remove_oldest(tmp_path, 50, 1.0)) == 1 and kept() == ["20260105"]  # the newest stays, whatever its size
    assert (tmp_path / "payload.loop").exists() and (tmp_path / "files-20250101T000000Z").exists()


def test_a_visit_removes_the_oldest_result_and_says_so(tmp_path):
    (tmp_path / "files-20200101T000000Z" / "dataset").mkdir(parents=True)
    (tmp_path / "files-20200102T000000Z" / "dataset").mkdir(parents=True)
    files = Files(settings_of(tmp_path, files_kept=1))
    assert len(list(tmp_path.iterdir())) == 2, "a start removes nothing: the bound may be new"
    state = worked(files, Commands(), ("a.csv", LOG), ("rows.csv", ROWS))
    assert (state["state"], state["removed"]) == ("done", 2)
    assert [path.name for path in tmp_path.iterdir()] == [state["folder"]]


@pytest.mark.parametrize("commands", [Commands(fails="dataset"), Commands(hangs=True)], ids=["refused", "cancelled"])
def test_a_visit_that_fails_or_is_cancelled_leaves_nothing(tmp_path, commands):
    state = worked(Files(settings_of(tmp_path)), commands, ("a.csv", LOG), ("b.wav", b"RIFF\0"))
    assert list(tmp_path.iterdir()) == []
    if commands.hangs:
        assert state["state"] == "cancelled"
    else:
        assert state["state"] == "failed" and state["error"].endswith("row 2 is bad") and "\n" not in state["error"]
        assert str(tmp_path) not in state["error"]


def test_one_visitor_at_a_time(tmp_path):
    files = Files(settings_of(tmp_path))

    async def scenario():
        await files.take("a.csv", body(LOG), "one")
        for refused in (lambda: files.take("b.csv", body(LOG), "two"), lambda: files.cancel("two")):
            with pytest.raises(UserError, match="another visitor"):
                await refused()
        with pytest.raises(UserError, match="another visitor"):
            files.start("two")
        files._forget()  # the first has gone
        assert list(tmp_path.iterdir()) == []
        await files.take("b.csv", body(LOG), "two")
        await files.cancel("two")
        for visit in ("one", "two"):
            with pytest.raises(UserError, match="cancelled"):
                await files.take("c.csv", body(LOG), visit)

    asyncio.run(scenario())
    assert [each["name"] for each in files.as_json()["files"]] == ["b.csv"] and list(tmp_path.iterdir()) == []


def test_files_of_a_visitor_who_has_gone_are_removed(tmp_path, monkeypatch):
    monkeypatch.setattr("acqd.web.files.SILENT_S", 0.01)
    files = Files(settings_of(tmp_path))

    async def scenario():
        await files.take("a.csv", body(LOG), "one")
        await until(lambda: files.state.state == "cancelled", "the end of the visit")

    finish(scenario())
    assert list(tmp_path.iterdir()) == []


async def stalled():
    yield b"1"
    await asyncio.sleep(60)


def test_a_file_that_stalls_keeps_nobody_out_and_is_cancelled(tmp_path):
    files = Files(settings_of(tmp_path))

    async def scenario():
        sending = asyncio.create_task(files.take("a.csv", stalled(), "one"))
        await until(lambda: list(tmp_path.rglob("*.part")), "the file begins")
        for refused in (lambda: files.take("b.csv", body(LOG), "one"), lambda: files.take("b.csv", body(LOG), "two")):
            with pytest.raises(UserError, match="try again in a minute"):
                await refused()
        await files.cancel("one")
        with pytest.raises(UserError, match="cancelled"):
            await sending
        assert list(tmp_path.iterdir()) == []
        await files.take("b.csv", body(LOG), "two")

    finish(scenario())


def test_a_file_that_comes_too_slowly_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(dropping, "SILENT_S", 0.02)
    with pytest.raises(UserError, match="nothing has come"):
        asyncio.run(Dropped(tmp_path, 10).take("a.csv", stalled()))
    monkeypatch.setattr(dropping, "SILENT_S", 60.0)
    monkeypatch.setattr(dropping, "_LEAST_RATE", 1e12)
    times = iter((0.0, 59.0, 61.0))
    monkeypatch.setattr(dropping, "time", SimpleNamespace(monotonic=lambda: next(times)))
    with pytest.raises(UserError, match="comes at less"):
        asyncio.run(Dropped(tmp_path, 10).take("a.csv", body(b"1", b"2")))
    assert list(tmp_path.iterdir()) == []


def test_small_files_do_not_fill_the_disk(tmp_path, monkeypatch):
    monkeypatch.setattr(dropping.shutil, "disk_usage", lambda _: SimpleNamespace(free=9))
    with pytest.raises(UserError, match="nearly full"):
        asyncio.run(Dropped(tmp_path, 10).take("a.csv", body(b"1")))


@pytest.mark.parametrize("answer", [b"[]", b'{"refusal": null, "rate": 4000.0}'])
def test_what_nobody_has_foreseen_ends_the_work_and_the_next_visit_begins(tmp_path, answer, monkeypatch):
    commands = Commands()

    async def run(arguments, told, secrets=None):
        if "--inspect" in arguments:
            return answer
        Path(arguments[-1]).write_bytes(b'{"channel": "L1", "P": 4.0, "W": 0.001}\n')
        return b""

    monkeypatch.setattr(commands, "run", run)
    files = Files(settings_of(tmp_path))
    state = worked(files, commands, ("a.wav", b"RIFF\0"))
    assert state["state"] == "failed" and state["error"].startswith("unexpected ") and "\n" not in state["error"]
    assert worked(files, Commands(), ("a.wav", b"RIFF\0"))["state"] == "done"


def test_the_energy_is_that_of_the_total_with_its_sign(tmp_path):
    rows = [(("L1", 9.0, 5.0), ("total", -3.0, -0.5)), (("L1", 9.0, 6.0), ("total", -5.0, -0.001))]
    (tmp_path / "rows").write_bytes(
        b"".join(orjson.dumps({"channel": c, "P": P, "W": W}) + b"\n" for pair in rows for c, P, W in pair)
    )
    assert figures_of(tmp_path / "rows", {"samples": 8000, "rate": 4000.0}).endswith("mean power -4 W, -1 Wh")


def written(path, content):
    path.write_bytes(content)
    return path


def parquet(path, *names):
    pyarrow = pytest.importorskip("pyarrow")
    pytest.importorskip("pyarrow.parquet").write_table(pyarrow.table({name: [0.0, 1.0] for name in names}), path)
    return path


def test_files_are_recognised_in_every_form_that_is_read(tmp_path):
    robot = load_description("iiwa7_r800")
    wide = LOG.decode().encode("utf-16")
    big = b"\xfe\xff" + (LOG * 3000).decode().encode("utf-16-be")
    joints = [f"q{axis}" for axis in range(1, 8)]
    for path, kind in (
        (parquet(tmp_path / "a.parquet", "time", *joints), "log"),
        (parquet(tmp_path / "b.parquet", "time", "P"), "power"),
        (parquet(tmp_path / "c.parquet", "time", "P", *joints), "log"),
        (written(tmp_path / "d.csv", wide), "log"), (written(tmp_path / "e.csv", big), "log"),
        (written(tmp_path / "f.csv", ROWS), "power"), (written(tmp_path / "g.csv", b"u1,i1\n1,2\n"), ""),
        (written(tmp_path / "h.parquet", b"no"), ""), (written(tmp_path / "i.csv", b""), ""),
        (written(tmp_path / "j.dat", LOG), "log"),
    ):  # fmt: skip
        assert kind_of(path, robot) == kind, path.name


def test_names_have_suffixes_that_readers_know(tmp_path):
    files, commands = Files(settings_of(tmp_path)), Commands()
    given = (("A", LOG), ("B.CSV", LOG), ("c.dat", LOG), ("P.CSV", ROWS), ("W.CFG", b"w\n1"), ("W.DAT", b"\0"))
    state = worked(files, commands, *given)
    assert [each["kind"] for each in state["files"]] == ["log", "log", "log", "power", "unknown", "part"]
    assert commands.logs == ["A.csv", "B.csv", "c.dat.csv"]


def test_messages_have_no_folders_of_this_computer(tmp_path):
    files = Files(settings_of(tmp_path))
    text = files._plain("/etc/acqd/model: has m/s; say which with --map u1=0, postgresql://u@h/db")
    assert text.startswith("model: has m/s; say which with --map u1=0, postgresql://u@h/db; the page has no options")


def test_the_work_of_another_page_is_left_alone(tmp_path):
    work = WorkFolder(tmp_path)
    other = WorkFolder(tmp_path)  # within the same second
    remove_left(tmp_path)
    assert work.path.is_dir() and other.path.is_dir() and work.path != other.path
    work.keep()
    os.close(other._lock)  # as when its page is killed
    remove_left(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == [work.name]


def test_results_of_visitors_are_no_report_of_the_loop(tmp_path):
    for name in ("files-20260101T000000Z", "loop-20260101T000000Z"):
        (tmp_path / name / "result").mkdir(parents=True)
        (tmp_path / name / "result" / "report.html").write_text(name)
    later = time.time() + 60
    os.utime(tmp_path / "files-20260101T000000Z" / "result" / "report.html", (later, later))
    assert newest_report(tmp_path) == tmp_path / "loop-20260101T000000Z" / "result"


def test_no_argument_holds_a_password():
    for url in ("postgresql://u:s3cret@h/db?sslmode=require", "postgresql://u@h/db?sslmode=require&password=s3cret"):
        assert without_password(url) == "postgresql://u@h/db?sslmode=require"
        assert password_of(url) == {"PGPASSWORD": "s3cret"}
    assert without_password("power.sqlite") == "power.sqlite" and password_of("power.sqlite") == {}
    assert without_password("sqlite:///power.sqlite") == "sqlite:///power.sqlite"


@pytest.fixture
def program(tmp_path, monkeypatch):
    """A function that has commands run some shell text in place of acqd."""

    def use(text):
        written(tmp_path / "program", f"#!/bin/sh\n{text}\n".encode()).chmod(0o700)
        monkeypatch.setattr("acqd.web.commands.sys.executable", str(tmp_path / "program"))
        return RealCommands()

    return use


def test_a_command_says_its_last_line_however_long_it_is(program):
    commands = program("head -c 300000 /dev/zero | tr '\\0' x >&2; echo >&2; echo 'acqd: so' >&2; exit 2")
    with pytest.raises(UserError, match=r"^so$"):
        asyncio.run(commands.run(["x"], lambda *_: None))
    with pytest.raises(UserError, match="needs more memory"):
        asyncio.run(program("kill -9 $$").run(["replay"], lambda *_: None))


def test_a_command_ends_when_nobody_listens_any_more(program):
    commands = program('echo \'{"step": "a", "share": 0}\' >&2; exec sleep 60')

    def told(step, share):
        raise RuntimeError(step)

    with pytest.raises(RuntimeError):
        asyncio.run(commands.run(["x"], told))
    assert commands.process.returncode is not None


def test_a_command_gives_way_and_goes_with_its_page():
    before = os.getpriority(os.PRIO_PROCESS, 0)
    child = os.fork()
    if not child:
        try:
            refuse = unittest.mock.Mock(side_effect=PermissionError)
            # as a filter of system calls may
            with unittest.mock.patch("os.nice", refuse), unittest.mock.patch("os.sched_setscheduler", refuse):
                give_way()
            give_way()
            wanted = ctypes.c_int()
            ctypes.CDLL(None).prctl(2, ctypes.byref(wanted))  # PR_GET_PDEATHSIG
            score = int(Path("/proc/self/oom_score_adj").read_text())
            given = (os.sched_getscheduler(0), os.getpriority(os.PRIO_PROCESS, 0), score)
            os._exit(0 if wanted.value and given == (os.SCHED_BATCH, min(before + 5, 19), 500) else 1)
        finally:
            os._exit(2)
    assert os.waitpid(child, 0)[1] == 0


def test_a_page_within_the_daemon_has_no_work_that_needs_memory(tmp_path):
    section = without_work(WebSection(reports=tmp_path, files=True))
    assert not section.files and not section.loop and section.reports == tmp_path


def test_requests_of_strangers_and_paths_beyond_the_results_are_refused(tmp_path):
    own = {"origin": "http://127.0.0.1:8731", "host": "127.0.0.1:8731", "x_acqd": "page"}
    on = settings_of(tmp_path)
    off = WebSettings(on.broker, on.database, on.health)
    for settings, headers in ((off, own), (on, {}), (on, own | {"origin": "http://evil"})):
        app = Starlette(routes=FilesRoutes(settings, LoopJob(settings)).routes())
        assert status(app, "POST", "/api/files/start", **headers)[0] == 403
    app = Starlette(routes=FilesRoutes(on, LoopJob(on)).routes())
    assert status(app, "POST", "/api/files/start", **own) == (409, '{"error":"there is no file yet"}')
    assert json.loads(status(app, "GET", "/api/files")[1])["state"] == "idle"
    for folder in (tmp_path / "files-20260101T000000Z" / "dataset", tmp_path / "dataset" / "dataset"):
        folder.mkdir(parents=True)
        (folder / "report.html").write_text("here")
    assert status(app, "GET", "/files/files-20260101T000000Z/dataset/report.html") == (200, "here")
    for folder, page in (("..", "dataset"), ("files-20260101T000000Z", ".."), ("dataset", "dataset")):
        assert status(app, "GET", f"/files/{folder}/{page}/report.html")[0] == 404
