"""Whether an installed service runs, and whether its unit can start it; with doubles of systemd's programs."""

from __future__ import annotations

import pwd
import time
from pathlib import Path

import pytest

from acqd.errors import UserError
from acqd.installation import plan, state
from acqd.installation.install import install
from acqd.installation.plan import Wanted, require_reachable
from acqd.installation.root import Root
from acqd.installation.state import last_line, state_of


def says(monkeypatch, **values):
    """`systemctl show` answers so; changed: seconds ago."""
    since = time.clock_gettime(time.CLOCK_MONOTONIC) - values.pop("changed", 3600)
    shown = {"SubState": "running", "NRestarts": "0", "StateChangeTimestamp": "Thu 2026-11-26 23:35:47 UTC"} | values
    lines = [f"{key}={value}" for key, value in shown.items()]
    answer = "\n".join([*lines, f"StateChangeTimestampMonotonic={max(0, round(since * 1e6))}"])
    monkeypatch.setattr(state, "_said", lambda *_: answer)


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ({"ActiveState": "active"}, "active"),
        ({"ActiveState": "activating", "SubState": "auto-restart", "NRestarts": "1"}, "failing"),
        ({"ActiveState": "active", "NRestarts": "9", "changed": 2}, "failing"),
        ({"ActiveState": "active", "NRestarts": "9"}, "active"),
        ({"ActiveState": "active", "NRestarts": "1", "changed": 2}, "active"),
        ({"ActiveState": "activating", "SubState": "start", "changed": 2}, "activating"),
        ({"ActiveState": "active", "SubState": "waiting", "NRestarts": "", "changed": 2}, "active"),
    ],
)
def test_a_service_that_systemd_starts_again_and_again_does_not_run(monkeypatch, values, expected):
    says(monkeypatch, **values)
    assert state_of("acqd-web.service") == (expected, "Thu 2026-11-26 23:35:47 UTC")


def test_the_log_says_why(monkeypatch):
    said = (
        "Started acqd-web.service.\nacqd: look at http://x\nacqd: acqd web needs uvicorn\nMain process exited, status=2"
    )
    monkeypatch.setattr(state, "_said", lambda *_: said)
    assert last_line("acqd-web.service") == "acqd web needs uvicorn"
    monkeypatch.setattr(state, "_said", lambda *_: "")
    assert last_line("acqd-web.service") == "" and state_of("acqd.service") == ("unknown", "")


def test_a_program_that_the_units_cannot_start_is_refused(monkeypatch, tmp_path):
    script = tmp_path / "acqd"
    script.write_text("#!/root/.pyenv/bin/python3\n")
    assert plan._interpreter(script) == "/root/.pyenv/bin/python3"
    require_reachable("/usr/bin/env")
    with pytest.raises(UserError, match="the units do not see /home; make the environment with the Python of the"):
        require_reachable("/home/x/.venv/bin/acqd")
    monkeypatch.setattr(plan, "_interpreter", lambda _: "/root/.pyenv/bin/python3")
    with pytest.raises(UserError, match=r"^/root/.*, which runs /usr/bin/env: the units do not see /root"):
        require_reachable("/usr/bin/env")
    monkeypatch.setattr(plan, "_HIDDEN", ())
    tmp_path.chmod(0o700)
    with pytest.raises(UserError, match="the user acqd may not enter /"):
        require_reachable(str(script))


@pytest.mark.parametrize(("mode", "opened"), [(0o755, True), (0o751, True), (0o750, True), (0o740, False)])
def test_a_folder_that_is_open_to_the_group_of_the_service_alone_is_no_obstacle(monkeypatch, tmp_path, mode, opened):
    group = tmp_path.stat().st_gid
    user = pwd.struct_passwd(("acqd", "x", 54_321, 54_321, "", "/", "/"))
    monkeypatch.setattr(plan.pwd, "getpwnam", lambda _: user)
    monkeypatch.setattr(plan.os, "getgrouplist", lambda *_: [54_321, group])
    tmp_path.chmod(mode)
    assert plan._open_to_service(tmp_path) == opened
    monkeypatch.setattr(plan.os, "getgrouplist", lambda *_: [54_321])
    assert plan._open_to_service(tmp_path) == bool(mode & 1)
    monkeypatch.setattr(plan.os, "listxattr", lambda _: ["system.posix_acl_access"])
    assert plan._open_to_service(tmp_path), "an access control list may name the user"


def test_without_systemd_nothing_is_changed(monkeypatch, tmp_path):
    monkeypatch.setattr(Root, "require_rights", lambda _: None)
    monkeypatch.setattr(Root, "managed", False)
    root = Root(Path("/"))
    monkeypatch.setattr(root, "at", lambda _: pytest.fail("the system is looked at"))
    with pytest.raises(UserError, match=r"--no-start only installs"):
        install(Wanted("/usr/bin/env"), root, start=True)
