"""Alarms: told once, again after a failure, reminded of, acknowledged, ended; nothing is lost by a restart."""

from __future__ import annotations

import asyncio
import json
import threading
from contextlib import contextmanager
from email import message_from_bytes, policy
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import aiomqtt
import orjson
import pytest

from acqd.integrations.alarms.book import Book
from acqd.integrations.alarms.history import History, read_history
from acqd.integrations.alarms.section import AlarmsSection
from acqd.integrations.alarms.sender import Sender
from acqd.integrations.alarms.service import Alarms
from acqd.integrations.alarms.targets import Mail, RefusedError, Webhook
from acqd.integrations.alarms.watch import ACKNOWLEDGE, ACTIVE, AlarmWatch
from acqd.integrations.bridge import Relay
from acqd.retry import RetryPolicy
from acqd.telemetry.broker import free_port
from acqd.telemetry.mqtt import BrokerAddress
from tests.commands import acqd_here, refused
from tests.integrations.messages import status
from tests.waiting import finish, until, wait_for

QUICK = RetryPolicy(first_s=0.01, longest_s=0.05)
RESIDUAL = ("acqd/cell/prediction/alarm", b'{"chart": "size up", "onset_s": 5.0}')


class Desk:
    """A watch with a clock of its own, and what it has told."""

    def __init__(self, delay_s=30.0, remind_s=3600.0):
        self.now_s, self.told = 1_800_000_000.0, []
        self.book = Book(remind_s)
        self.watch = AlarmWatch(self.book, self._tell, delay_s, lambda: round(self.now_s * 1e9))

    def _tell(self, notification):
        self.told.append((notification.event, notification.alarm.key))

    def after(self, seconds, *message):
        self.now_s += seconds
        told, self.told = self.told, []
        del told
        messages = list(self.watch.take(*message) if message else self.watch.tick())
        return self.told, messages


def test_the_history_says_from_when_until_when_and_who(tmp_path):
    path, now_s = tmp_path / "a.history.jsonl", 1_800_000_000
    book, history = Book(remind_s=10.0), History(path, most=4)

    def told(notifications, after_s):
        for each in notifications:
            history.add(each, (now_s + after_s) * 10**9)

    told(book.raise_("cell/residual", "changed", now_s * 10**9, "one"), 0)
    told(book.remind((now_s + 60) * 10**9), 60)
    told(book.acknowledge("cell/residual", "Ada"), 70)
    told(book.raise_("cell/residual", "changed again", (now_s + 80) * 10**9, "two"), 80)
    told(book.raise_("hall/spool", "nearly full", (now_s + 90) * 10**9), 90)
    told(book.resolve("hall/spool"), 100)
    with path.open("a") as file:
        file.write('{"time": "2027-01-15T08:')  # a power cut
    found = read_history(path)
    assert [(one["key"], one["since"][14:19], one["resolved"][14:19], one["acknowledged_by"]) for one in found] == [
        ("hall/spool", "01:30", "01:40", ""), ("cell/residual", "01:20", "", ""),
        ("cell/residual", "00:00", "01:20", "Ada"),
    ]  # fmt: skip
    told(book.raise_("hall/clock", "wrong", (now_s + 110) * 10**9), 110)
    assert read_history(path)[0]["key"] == "hall/clock"
    for k in range(6):
        told(book.raise_(f"d{k}/disk", "full", (now_s + 200 + k) * 10**9), 200 + k)
    assert path.read_bytes().count(b"\n") < 8 and read_history(path)[0]["key"] == "d5/disk"


def test_the_history_is_a_command(tmp_path):
    (tmp_path / "acqd.toml").write_text(f"[alarms]\nstate = '{tmp_path / 'a.json'}'\n")
    asked = ("alarms", "history", "--config", tmp_path / "acqd.toml")
    assert "a.history.jsonl: no such file" in refused(acqd_here(*asked))
    with Alarms(AlarmsSection(state=tmp_path / "a.json")) as alarms:
        list(alarms.watch.take(*RESIDUAL))
    (alarm,) = json.loads(acqd_here(*asked, "--json").stdout)
    assert alarm["key"] == "cell/residual" and not alarm["resolved"] and "active" in acqd_here(*asked).stdout


def test_a_residual_is_told_once_and_again_when_it_changes():
    desk = Desk()
    assert desk.after(0, *RESIDUAL)[0] == [("raised", "cell/residual")]
    assert desk.after(5, *RESIDUAL)[0] == []
    assert desk.after(5, RESIDUAL[0], b'{"chart": "mean"}')[0] == [("raised", "cell/residual")]
    assert desk.after(5, RESIDUAL[0], b"")[0] == [("resolved", "cell/residual")]
    for payload in (b"{", b"[]", b"5"):
        assert desk.after(0, RESIDUAL[0], payload)[0] == []


def test_a_short_absence_of_a_daemon_is_no_alarm_and_a_long_one_is():
    desk = Desk()
    desk.after(0, "acqd/cell/status", b"offline")
    assert desk.after(20, *status("cell"))[0] == [] and desk.after(60)[0] == []
    desk.after(0, "acqd/cell/status", b"offline")
    assert desk.after(29)[0] == [] and desk.after(2)[0] == [("raised", "cell/offline")]
    assert desk.after(1, "acqd/cell/status", b"offline")[0] == [] and desk.after(60)[0] == []
    assert desk.after(1, *status("cell"))[0] == [("resolved", "cell/offline")]


@pytest.mark.parametrize(
    ("content", "kind"),
    [({"source_health": {"connected": False, "reason": "no answer"}}, "source"),
     ({"meters": {"press-1": {"trouble": "no answer"}}}, "meter-press-1"),
     ({"boxes": {"b": {"trouble": "ended"}}}, "box-b"),
     ({"boxes": {"b": {"source_health": {"connected": False}}}}, "source-b"),
     ({"spool": {"disk_trouble": "full"}}, "disk"),
     ({"spool": {"spool_bytes": 95, "spool_limit_bytes": 100}}, "spool")],
)  # fmt: skip
def test_troubles_of_a_daemon_that_is_online(content, kind):
    desk = Desk(delay_s=0)
    desk.after(0, *status("cell", **content))
    assert desk.after(1)[0] == [("raised", f"cell/{kind}")]
    assert desk.after(1, *status("cell"))[0] == [("resolved", f"cell/{kind}")]


def test_reminders_until_somebody_acknowledges():
    desk = Desk()
    desk.after(0, *RESIDUAL)
    assert desk.after(3500)[0] == [] and desk.after(200)[0] == [("reminder", "cell/residual")]
    assert desk.after(60)[0] == []
    told, messages = desk.after(1, ACKNOWLEDGE, b'{"key": "cell/residual", "by": "Ada"}')
    assert told == [("acknowledged", "cell/residual")]
    (message,) = messages
    assert message.topic == ACTIVE and message.retain and orjson.loads(message.payload)[0]["acknowledged_by"] == "Ada"
    assert desk.after(99_999)[0] == [] and desk.after(0, ACKNOWLEDGE, b'{"key": "cell/residual"}')[0] == []
    for payload in (b"", b"[]", b'{"by": "x"}', b'{"key": "none"}'):
        assert desk.after(0, ACKNOWLEDGE, payload)[0] == []


class Flaky:
    """A target that fails, and then takes everything."""

    name = "flaky"

    def __init__(self, failures, refuse=()):
        self.failures, self.refuse, self.sent = failures, refuse, []

    def send(self, content):
        if self.failures:
            self.failures -= 1
            raise OSError("away")
        if content["key"] in self.refuse:
            raise RefusedError("never")
        self.sent.append(content["key"])


def test_a_target_is_tried_again_in_order_and_a_refusal_does_not_stop_the_others():
    target = Flaky(3, refuse={"b"})
    with Sender([target], lambda: None, QUICK) as sender:
        for key in "abc":
            sender.put({"key": key})
        wait_for(lambda: target.sent == ["a", "c"], "sent")
        wait_for(lambda: sender.waiting() == {"flaky": []}, "nothing waits")


@contextmanager
def http_double(answers):
    """Address of a server that gives these answers, and what it has got."""
    got = []

    class Page(BaseHTTPRequestHandler):
        def do_POST(self):
            body = self.rfile.read(int(self.headers["Content-Length"]))
            code = answers.pop(0) if answers else 200
            if code == 200:
                got.append(json.loads(body))
            self.send_response(code)
            self.end_headers()

        def log_message(self, *_):
            return

    with ThreadingHTTPServer(("127.0.0.1", 0), Page) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/hook", got
        server.shutdown()


@contextmanager
def smtp_double(first_answers=()):
    """Port of an SMTP server, and the messages that it has taken."""
    controller = pytest.importorskip("aiosmtpd.controller", reason="needs acqd[dev]")
    got, answers = [], list(first_answers)

    class Handler:
        async def handle_DATA(self, server, session, envelope):  # noqa: N802
            if answers:
                return answers.pop(0)
            got.append((envelope.rcpt_tos, message_from_bytes(envelope.content, policy=policy.default)))
            return "250 OK"

    port = free_port()
    running = controller.Controller(Handler(), hostname="127.0.0.1", port=port)
    running.start()
    yield port, got
    running.stop()


@pytest.mark.parametrize(("code", "error"), [(503, OSError), (429, OSError), (404, RefusedError)])
def test_what_a_webhook_answers(code, error):
    with http_double([code]) as (url, got):
        hook = Webhook(url, "webhook 1")
        with pytest.raises(error, match=str(code)):
            hook.send({"key": "a"})
        hook.send({"key": "a"})
        assert got == [{"key": "a"}]


def test_mail_is_a_message_that_says_what_to_do():
    with smtp_double(["451 later", "554 never"]) as (port, got):
        mail = Mail(AlarmsSection(mail_to=["a@x.org", "b@x.org"], smtp_port=port))
        content = {"key": "cell/residual", "text": "[acqd] raised: ümläut\nBcc: injected@x.org", "event": "raised"}
        with pytest.raises(OSError, match="later"):
            mail.send(content)
        with pytest.raises(RefusedError, match="never"):
            mail.send(content)
        mail.send(content)
        ((to, message),) = got
    assert to == ["a@x.org", "b@x.org"] and "acqd alarms acknowledge cell/residual" in message.get_content()
    assert message["X-Acqd-Key"] == "cell/residual" and "ümläut" in message["Subject"] and message["Bcc"] is None


def test_what_was_not_delivered_before_a_restart_is_delivered_after_it_and_nothing_twice(tmp_path):
    with http_double([]) as (url, got):
        section = AlarmsSection(webhooks=["http://127.0.0.1:1/"], state=tmp_path / "state.json")
        with Alarms(section) as alarms:
            list(alarms.watch.take(*RESIDUAL))
        again = section.model_copy(update={"webhooks": [url]})
        for _ in range(2):
            with Alarms(again) as alarms:
                list(alarms.watch.take(*RESIDUAL))
                wait_for(lambda: not alarms.sender.waiting()["webhook 1"], "delivered")
    assert [(each["event"], each["key"]) for each in got] == [("raised", "cell/residual")]
    (tmp_path / "state.json").write_text('{"alarms": [5]}')
    assert Alarms(section).watch is not None


def test_acknowledged_through_a_broker_by_the_command(mosquitto, tmp_path):
    with http_double([]) as (url, got):
        section = AlarmsSection(webhooks=[url], state=tmp_path / "state.json", delay_s=0)

        async def scenario():
            stop = asyncio.Event()
            with Alarms(section) as alarms:
                relaying = asyncio.create_task(
                    Relay(BrokerAddress(port=mosquitto.port), alarms.watch, "alarms").run(stop)
                )
                async with aiomqtt.Client("127.0.0.1", mosquitto.port) as client:
                    await client.publish(*RESIDUAL, qos=1, retain=True)
                    await client.publish("acqd/cell/status", b"offline", 1, retain=True)
                await until(lambda: len(got) == 2, "told")
                port = ("--port", mosquitto.port)
                listed = await asyncio.to_thread(acqd_here, "alarms", "list", "--json", *port)
                done = await asyncio.to_thread(
                    acqd_here, "alarms", "acknowledge", "cell/residual", "--by", "Ada", *port
                )
                unknown = await asyncio.to_thread(acqd_here, "alarms", "acknowledge", "cell/none", *port)
                await until(lambda: len(got) == 3, "told")
                stop.set()
                await relaying
            return listed, done, unknown

        results = []
        finish(run_into(results, scenario()))
    listed, done, unknown = results[0]
    assert listed.returncode == 1 and {each["key"] for each in json.loads(listed.stdout)} == {
        "cell/residual", "cell/offline",
    }  # fmt: skip
    assert done.returncode == 0 and (unknown.returncode, "acqd alarms list" in unknown.stderr) == (2, True)
    assert {each["event"] for each in got} == {"raised", "acknowledged"}
    assert next(each for each in got if each["event"] == "acknowledged")["acknowledged_by"] == "Ada"


async def run_into(results, scenario):
    results.append(await scenario)


def test_damaged_lines_of_the_history_are_counted(tmp_path, caplog):
    (path := tmp_path / "a.history.jsonl").write_bytes(b"\xff\xfe\n{}\n3\n")
    assert read_history(path) == [] and "3 of 3 lines are damaged and left out" in caplog.text


@pytest.mark.parametrize("name", ["Ada\nLovelace", "   ", "a" * 101])
def test_who_acknowledges_is_a_name_in_one_line(name, tmp_path):
    said = refused(acqd_here("alarms", "acknowledge", "hall/clock", "--by", name, "--port", "9", cwd=tmp_path))
    assert "expected a name of at most 100 letters in one line" in said
