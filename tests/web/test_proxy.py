"""The page behind a reverse proxy that people log in to: headers are believed from the proxy only, roles hold."""

from __future__ import annotations

import asyncio
import contextlib
import gzip
import json
import shutil
import subprocess
import threading
from http.client import HTTPConnection
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest
from starlette.datastructures import Headers
from starlette.requests import Request

from acqd.daemon.config import Config
from acqd.daemon.config_checks import _secrets
from acqd.daemon.health.section import HealthSection
from acqd.daemon.web_section import ProxySection, WebSection
from acqd.errors import UserError
from acqd.telemetry.broker import free_port
from acqd.telemetry.mqtt import BrokerAddress
from acqd.web.proxy import PROOF, BehindProxy, Person
from acqd.web.settings import WebSettings
from tests.places import ROOT
from tests.waiting import wait_for

pytest.importorskip("uvicorn")
SECRET = "0123456789abcdef0123"
PEOPLE = {"ada": "acqd-read,staff", "bob": "acqd-act", "eve": "staff"}
CONFIG = ROOT / "config" / "nginx" / "acqd-openid.conf"


def section_of(tmp_path, **more):
    (tmp_path / "secret").write_text(f"{SECRET}\n")
    proxy = ProxySection(secret_file=tmp_path / "secret", read=["acqd-read"], act=["acqd-act"])
    return WebSection(proxy=proxy, reports=tmp_path, files=True, **more)


def settings_with(section, port=8731):
    broker, health = BrokerAddress("127.0.0.1", 1), HealthSection(port=0, sink_port=0)
    return WebSettings(broker, "none.sqlite", health, port=port, section=section, proxy_secret=section.proxy.secret())


def status(app, method, path, **headers):
    """Status and body of one request to an ASGI application."""
    answers = []

    async def receive():
        return {"type": "http.request", "body": b""}

    async def send(message):
        answers.append(message)

    named = [(name.replace("_", "-").encode(), value.encode()) for name, value in headers.items()]
    scope = {"type": "http", "method": method, "path": path, "headers": named, "query_string": b"", "scheme": "http"}
    asyncio.run(app(scope | {"client": ("127.0.0.1", 1), "asgi": {"spec_version": "2.4"}}, receive, send))
    return answers[0]["status"], b"".join(answer.get("body", b"") for answer in answers).decode()


def test_headers_are_believed_with_the_secret_only_and_roles_hold(tmp_path):
    from acqd.web.app import Site

    app = Site(settings_with(section_of(tmp_path))).app()
    bob = {"x_auth_request_user": "bob", "x_auth_request_groups": "acqd-act"}
    ada = {"x_auth_request_user": "ada", "x_auth_request_groups": "acqd-read,staff"}
    page = {"origin": "http://acqd.example", "host": "acqd.example", "x_acqd": "page"}
    for forged in ({}, {"x_acqd_proxy": ""}, {"x_acqd_proxy": SECRET[:-1]}):
        assert status(app, "GET", "/api/arm", **bob, **forged) == (
            403,
            "acqd: this page is behind a proxy: ask for it there\n",
        )
    known = {"x_acqd_proxy": SECRET}
    assert status(app, "GET", "/api/arm", **ada, **known)[0] == 200
    assert "names nobody" in status(app, "GET", "/api/arm", **known)[1]
    eve = {"x_auth_request_user": "eve", "x_auth_request_groups": "staff"}
    assert "eve has no group that may look" in status(app, "GET", "/api/arm", **eve, **known)[1]
    code, words = status(app, "POST", "/api/files/cancel", **ada, **known, **page)
    assert code == 403 and "ada may look, and not act" in words
    assert status(app, "POST", "/api/files/cancel", **bob, **known, **page)[0] == 200
    assert json.loads(status(app, "GET", "/api/files", **ada, **known)[1]) == {"enabled": False}
    assert json.loads(status(app, "GET", "/api/files", **bob, **known)[1])["enabled"] is True


def test_a_secret_that_is_missing_or_short_is_refused_in_one_line(tmp_path):
    section = section_of(tmp_path)
    (tmp_path / "secret").write_text("short")
    with pytest.raises(UserError, match="20 letters or more"):
        section.proxy.secret()
    (tmp_path / "secret").unlink()
    with pytest.raises(UserError, match="no such file"):
        section.proxy.secret()
    with pytest.raises(ValueError, match="no group"):
        ProxySection(secret_file=tmp_path / "secret")
    with pytest.raises(ValueError, match="user_header"):
        ProxySection(secret_file=tmp_path / "secret", act=["acqd-act"], user_header="X Bad Header:")


def test_files_of_the_page_travel_compressed(tmp_path):
    from acqd.web.app import _ASSETS, _file

    plain = (_ASSETS / "page.js").read_bytes()
    for accepted, coding in (("gzip, br", "gzip"), ("", None)):
        request = Request({"type": "http", "headers": [(b"accept-encoding", accepted.encode())]})
        answer = asyncio.run(_file(_ASSETS / "page.js", request, {}))
        assert answer.headers.get("content-encoding") == coding and "javascript" in answer.headers["content-type"]
        if coding:
            assert len(answer.body) < len(plain) / 2 and gzip.decompress(answer.body) == plain


def test_names_and_groups_of_any_alphabet_are_people(tmp_path):
    section = section_of(tmp_path)
    section.proxy.read.append("Prüfer")
    proxy = BehindProxy(None, secret=SECRET, section=section.proxy)
    for name in ("Weiß", "Łukasz", "李雷"):
        for coding in ("utf-8", "latin-1"):
            with contextlib.suppress(UnicodeEncodeError):
                sent = {PROOF: SECRET, "x-auth-request-user": name, "x-auth-request-groups": "Prüfer"}
                raw = [(key.encode(), value.encode(coding)) for key, value in sent.items()]
                assert proxy._person(Headers(raw=raw)) == Person(name, acts=False)


def test_the_check_of_a_configuration_reads_the_secret(tmp_path):
    config = Config.model_construct(web=section_of(tmp_path))
    for mode, state in ((0o666, "warn"), (0o640, "ok")):
        (tmp_path / "secret").chmod(mode)
        assert [each.state for each in _secrets(config)] == [state]
    (tmp_path / "secret").unlink()
    assert "no such file" in next(_secrets(config)).finding


def test_the_cookie_secret_is_base64_for_addresses():
    """With a double of openssl: bytes that are + and / in the usual alphabet."""
    command = (CONFIG.parent / "oauth2-proxy.cfg").read_text().partition("# openssl")[2].splitlines()[0]
    whole = f"made() {{ printf '{'+/' * 21}8=\\n'; }}; made {command}"
    made = subprocess.run(["sh", "-c", whole], capture_output=True, check=True).stdout
    assert made == b"-_" * 21 + b"8="


class Login(BaseHTTPRequestHandler):
    """What nginx asks oauth2-proxy: the cookie is the name."""

    def do_GET(self):
        name = self.headers.get("Cookie", "").partition("=")[2]
        self.send_response(202 if name in PEOPLE else 401)
        if name in PEOPLE:
            self.send_header("X-Auth-Request-User", name)
            self.send_header("X-Auth-Request-Groups", PEOPLE[name])
        self.send_header("Content-Length", "0")
        self.end_headers()

    def log_message(self, *_):
        pass


@pytest.fixture
def nginx(tmp_path):
    """The example of the documentation without TLS, between a double of oauth2-proxy and the page; its port."""
    program = shutil.which("nginx")
    if program is None:
        pytest.skip("nginx is not installed")
    from tests.web.test_in_a_browser import Served

    login = ThreadingHTTPServer(("127.0.0.1", 0), Login)
    threading.Thread(target=login.serve_forever, daemon=True).start()
    served = Served(settings_with(section_of(tmp_path), free_port()))
    port, secret = free_port(), tmp_path / "nginx-secret.conf"
    secret.write_text(f'proxy_set_header X-Acqd-Proxy "{SECRET}";\n')
    text = "\n".join(line for line in CONFIG.read_text().splitlines() if "ssl_certificate" not in line)
    for shipped, here in (
        ("443 ssl", f"127.0.0.1:{port}"), ("127.0.0.1:4180", f"127.0.0.1:{login.server_port}"),
        ("127.0.0.1:8731", f"127.0.0.1:{served.server.config.port}"),
        ("/etc/nginx/acqd-proxy-secret.conf", str(secret)),
    ):  # fmt: skip
        assert shipped in text
        text = text.replace(shipped, here)
    paths = "".join(
        f"{name}_temp_path {tmp_path}/{name};\n" for name in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")
    )
    whole = f"error_log stderr;\npid {tmp_path}/pid;\nevents {{}}\nhttp {{\naccess_log off;\n{paths}{text}\n}}\n"
    (tmp_path / "nginx.conf").write_text(whole)
    process = subprocess.Popen([program, "-c", tmp_path / "nginx.conf", "-g", "daemon off;"], stderr=subprocess.DEVNULL)
    yield port, served.server.config.port
    process.terminate()
    process.wait(20)
    served.stop()
    login.shutdown()


def ask(port, method, path, headers, body=None):
    connection = HTTPConnection("127.0.0.1", port, timeout=60)
    connection.request(method, path, body, headers)
    answer = connection.getresponse()
    return answer.status, answer.read().decode(), answer.headers


def reachable(port):
    try:
        return bool(ask(port, "GET", "/", {}))
    except OSError:
        return False


def test_nginx_names_people_and_nobody_else_can(nginx):
    port, behind = nginx
    wait_for(lambda: reachable(port) and reachable(behind), "nginx and the page answer")
    host = f"acqd.example:{port}"
    forged = {"Host": host, "X-Auth-Request-User": "bob", "X-Auth-Request-Groups": "acqd-act", "X-Acqd-Proxy": "x" * 20}
    code, _, headers = ask(port, "GET", "/", forged)
    assert code == 302 and headers["Location"].endswith("/oauth2/start?rd=/")
    assert ask(behind, "GET", "/", forged)[0] == 403  # past the proxy
    ada = {"Host": host, "Cookie": "name=ada"}
    assert "<title>acqd</title>" in ask(port, "GET", "/", ada)[1]
    own = {"Origin": f"http://{host}", "x-acqd": "page"}
    code, words, _ = ask(port, "POST", "/api/files/add?name=a.csv", forged | ada | own, b"time,q1\n")
    assert code == 403 and "ada may look, and not act" in words  # whatever the client calls itself
    code, words, _ = ask(
        port, "POST", "/api/files/add?name=a.csv", {"Host": host, "Cookie": "name=bob"} | own, b"time,q1\n"
    )
    assert code == 200 and json.loads(words)["files"][0]["name"] == "a.csv"
    assert "no group that may look" in ask(port, "GET", "/", {"Host": host, "Cookie": "name=eve"})[1]
