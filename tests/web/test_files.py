"""Files that visitors drop on the page: safe names, limits, one visit at a time, results complete or not there."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path

import orjson
import pytest

from acqd.daemon.health.section import HealthSection
from acqd.daemon.web_section import WebSection
from acqd.errors import UserError
from acqd.telemetry.mqtt import BrokerAddress
from acqd.web.dropped import Dropped
from acqd.web.files import Files
from acqd.web.files_routes import FilesRoutes
from acqd.web.job import LoopJob
from acqd.web.settings import WebSettings
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
        self.ran, self.fails, self.hangs, self.ended = [], fails, hangs, False

    async def run(self, arguments, told, secrets=None):
        told("half", 0.5)
        self.ran.append(arguments)
        if self.hangs:
            await asyncio.sleep(60)
        if arguments[0] == self.fails:
            raise UserError(f"{arguments[-1]}: row 2 is bad")
        if "--inspect" in arguments:
            if not arguments[2].endswith(".wav"):
                raise UserError("unknown kind of waveform file")
            return orjson.dumps({"refusal": "", "samples": 8000, "rate": 4000.0})
        out = Path(arguments[arguments.index("--out") + 1])
        if arguments[0] == "replay":
            out.write_bytes(b'{"channel": "L1", "P": 4.0, "W": 0.001}\n{"channel": "L1", "P": 6.0, "W": 0.002}\n')
        else:
            out.mkdir()
            (out / "report.html").write_text("report")
        return b""

    async def end(self):
        self.ended = True


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

    assert take("../../etc/pass wd", b"12345") == "pass_wd"
    assert take("C:\\logs\\.hidden.csv", b"1") == "hidden.csv"
    for name, pieces, words in (
        ("big.csv", (b"123", b"45"), "more than 0 MB in all"), ("pass wd", (b"1",), "already"),
        ("..", (b"1",), "a name"),
        ("empty.csv", (), "empty"), ("\0\n", (b"1",), "a name"),
    ):  # fmt: skip
        with pytest.raises(UserError, match=words):
            take(name, *pieces)
    assert sorted(path.name for path in tmp_path.rglob("*") if path.is_file()) == ["hidden.csv", "pass_wd"]


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


@pytest.mark.parametrize("commands", [Commands(fails="dataset"), Commands(hangs=True)], ids=["refused", "cancelled"])
def test_a_visit_that_fails_or_is_cancelled_leaves_nothing(tmp_path, commands):
    state = worked(Files(settings_of(tmp_path)), commands, ("a.csv", LOG), ("b.wav", b"RIFF\0"))
    assert list(tmp_path.iterdir()) == []
    if commands.hangs:
        assert state["state"] == "cancelled" and commands.ended
    else:
        assert state["state"] == "failed" and state["error"].endswith("row 2 is bad") and "\n" not in state["error"]
        assert str(tmp_path) not in state["error"]


def test_one_visitor_at_a_time(tmp_path):
    files = Files(settings_of(tmp_path))
    asyncio.run(files.take("a.csv", body(LOG), "one"))
    with pytest.raises(UserError, match="another visitor"):
        asyncio.run(files.take("b.csv", body(LOG), "two"))
    files._heard -= 100  # the first has gone
    asyncio.run(files.take("b.csv", body(LOG), "two"))
    assert [each["name"] for each in files.as_json()["files"]] == ["b.csv"]


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
