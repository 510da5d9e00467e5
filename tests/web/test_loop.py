"""The loop from the page: one job at a time, cancelled cleanly, nothing applied without a name."""

from __future__ import annotations

import asyncio
import json
from types import SimpleNamespace
from unittest.mock import AsyncMock

import pytest

from acqd.daemon.health.section import HealthSection
from acqd.daemon.web_section import WebSection
from acqd.errors import UserError
from acqd.storage.database import open_database
from acqd.storage.schema import prediction_log
from acqd.telemetry.mqtt import BrokerAddress
from acqd.web.applying import applied, apply
from acqd.web.job import LoopJob
from acqd.web.loop_routes import LoopRoutes, own_request
from acqd.web.settings import WebSettings
from tests.waiting import finish, until

Starlette = pytest.importorskip("starlette.applications").Starlette

ALARM = {"chart": "level up", "onset_s": 1_700_000_060.0, "raised_s": 1_700_000_090.0, "height": 1.1, "log": "b.csv"}


@pytest.fixture
def settings(tmp_path):
    """Two logs, of which the second ends after the alarm's onset; their content is garbled."""
    logs, model, reports = tmp_path / "logs", tmp_path / "model", tmp_path / "loops"
    for folder in (logs, model, reports):
        folder.mkdir()
    (model / "bundle.json").write_text('{"old": 1}')
    engine = open_database(str(tmp_path / "power.sqlite"))
    with engine.begin() as connection:
        for name, minute, alarm in (("a.csv", 13, None), ("b.csv", 15, ALARM), ("../c.csv", 16, None)):
            (logs / name).write_text("time,q1\n1,x\n")
            message = {
                "begin": f"2023-11-14T22:{minute}:00.000Z",
                "end": f"2023-11-14T22:{minute}:30.000Z",
                "alarm": alarm,
            }
            connection.execute(
                prediction_log.insert().values(
                    sha256=name, name=name, model="m", status="ok", message=message, published=True, done=str(minute)
                )
            )
    section = WebSection(reports=reports, loop=True, logs=logs, model=model)
    broker, health = BrokerAddress("127.0.0.1", 1), HealthSection(port=0, sink_port=0)
    return WebSettings(broker, str(tmp_path / "power.sqlite"), health, section=section)


def test_a_job_takes_the_logs_since_the_alarm_and_is_cancelled_with_its_process(settings):
    engine = open_database(settings.database)
    seen = []

    async def scenario():
        job = LoopJob(settings)
        job.start(engine, "", ALARM["onset_s"])
        linked = [path.name for path in (settings.section.reports / job.state.folder / "logs").iterdir()]
        with pytest.raises(UserError, match="running already"):
            job.start(engine, "", ALARM["onset_s"])
        job.run()
        await until(lambda: job._commands.process is not None, "a process")
        process = job._commands.process
        await job.cancel()
        seen.extend([linked, job.state.state, process.returncode is not None])

    finish(scenario())
    assert seen == [["b.csv"], "cancelled", True]
    with pytest.raises(UserError, match="no log"):
        LoopJob(settings).start(engine, "", 2e9)


def test_what_nobody_has_foreseen_ends_a_job(settings, monkeypatch):
    async def scenario():
        job = LoopJob(settings)
        job.start(open_database(settings.database), "", ALARM["onset_s"])
        monkeypatch.setattr(job._commands, "run", AsyncMock(side_effect=KeyError("step")))
        job.run()
        await until(lambda: not job.running, "the end of the job")
        assert job.state.state == "failed" and job.state.error.startswith("unexpected KeyError: 'step'")

    finish(scenario())


@pytest.mark.slow
def test_a_job_that_fails_says_why_in_one_line(settings):
    states = []

    async def scenario():
        job = LoopJob(settings)
        job.start(open_database(settings.database), "", ALARM["onset_s"])
        job.run()
        await until(lambda: job.state.state != "running", "the end of the job")
        states.append(job.state)

    finish(scenario())
    assert states[0].state == "failed" and "\n" not in states[0].error and "Traceback" not in states[0].error
    assert states[0].error


def proposal_of(folder, added):
    (folder / "result" / "model").mkdir(parents=True)
    (folder / "result" / "model" / "bundle.json").write_text('{"new": 1}')
    (folder / "result" / "report.json").write_text(json.dumps({"effects": [{"id": "payload", "added": added}]}))
    return folder / "result" / "model"


def test_a_model_is_replaced_with_a_name_and_the_old_one_is_kept(settings, tmp_path):
    proposal, model, log = proposal_of(tmp_path / "job", True), settings.section.model, tmp_path / "applied.jsonl"
    for name in ("", " x ", "a\nb"):
        with pytest.raises(UserError, match="your name"):
            apply(proposal, model, log, name, "127.0.0.1")
    assert not log.exists()
    apply(proposal, model, log, "E. Example", "127.0.0.1")
    (line,) = applied(log)
    assert json.loads((model / "bundle.json").read_text()) == {"new": 1}
    assert (tmp_path / line["kept"] / "bundle.json").read_text() == '{"old": 1}' and line["name"] == "E. Example"
    assert line["sha256_before"] != line["sha256_after"] and len(list(tmp_path.glob("*model*"))) == 2


def test_a_search_that_added_nothing_replaces_nothing(settings, tmp_path):
    with pytest.raises(UserError, match="nothing was added"):
        apply(proposal_of(tmp_path / "job", False), settings.section.model, tmp_path / "log", "E. Example", "")
    assert (settings.section.model / "bundle.json").read_text() == '{"old": 1}'


def request(**headers):
    own = {"origin": "http://127.0.0.1:8731", "host": "127.0.0.1:8731", "x-acqd": "page"}
    return SimpleNamespace(
        headers={k: v for k, v in (own | {n.replace("_", "-"): h for n, h in headers.items()}).items() if v}
    )


def test_only_the_page_itself_can_change_something():
    assert own_request(request()) and own_request(request(sec_fetch_site="same-origin"))
    for foreign in (
        {"origin": "http://evil.example"}, {"origin": "null"}, {"origin": ""}, {"x_acqd": ""},
        {"sec_fetch_site": "cross-site"}, {"origin": "http://127.0.0.1:8731.evil.example"},
    ):  # fmt: skip
        assert not own_request(request(**foreign)), foreign


def sent(routes, method, path, body=b"", **headers):
    """Status and JSON of one request to an ASGI application."""
    app, answers = Starlette(routes=routes), []

    async def receive():
        return {"type": "http.request", "body": body}

    async def send(message):
        answers.append(message)

    named = [(name.replace("_", "-").encode(), value.encode()) for name, value in headers.items()]
    scope = {"type": "http", "method": method, "path": path, "headers": named, "query_string": b""}
    asyncio.run(app(scope | {"client": ("127.0.0.1", 1), "http_version": "1.1", "scheme": "http"}, receive, send))
    return answers[0]["status"], json.loads(answers[1]["body"])


def test_the_loop_is_off_unless_it_is_configured(settings):
    def routes(chosen):
        return LoopRoutes(chosen, lambda: open_database(settings.database)).routes()

    own = {"origin": "http://127.0.0.1:8731", "host": "127.0.0.1:8731", "x_acqd": "page"}
    off = WebSettings(settings.broker, settings.database, settings.health)
    start = ("POST", "/api/loop/start", b'{"since": 1.0}')
    assert sent(routes(off), *start, **own)[0] == 403 and sent(routes(settings), *start)[0] == 403
    assert sent(routes(off), "GET", "/api/loop") == (200, {"enabled": False})
    code, stale = sent(routes(settings), "POST", "/api/loop/apply", b'{"folder": "x", "name": "E. Example"}', **own)
    assert code == 409 and "newest" in stale["error"]
    assert sent(routes(settings), "POST", "/api/loop/apply", b"{}", **own)[0] in (400, 409)
    assert sent(routes(settings), "GET", "/api/loop")[1]["alarms"] == [ALARM]


def test_the_section_names_what_the_loop_needs():
    with pytest.raises(ValueError, match="logs and model are not set"):
        WebSection(loop=True, reports="loops")


def test_cancelling_without_a_job_does_nothing(settings):
    asyncio.run(LoopJob(settings).cancel())
