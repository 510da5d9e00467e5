"""The tree of commands imports what a command line needs."""

import errno
import re
import socket
import subprocess
import sys
from collections import defaultdict

import pytest
import typer.main
from rich import markup

from acqd.cli.commands import command_tree
from acqd.errors import UserError
from acqd.telemetry.ports import check_port
from tests.commands import acqd_here, refused
from tests.places import ROOT


def names(app):
    return set(typer.main.get_command(app).commands)


def helps(command):
    """Every text that --help prints, of a command and those below it."""
    yield from (text for text in (command.help, *(getattr(p, "help", None) for p in command.params)) if text)
    for each in getattr(command, "commands", {}).values():
        yield from helps(each)


def test_a_command_line_has_the_command_that_it_starts_with():
    everything = names(command_tree())
    assert {"run", "sink", "close-loop", "lab", "broker"} <= everything
    for name in everything:
        assert names(command_tree([name, "--json"])) == {name}
    for line in ([], ["--help"], ["--version"], ["snik"]):
        assert names(command_tree(line)) == everything


def test_the_readme_has_every_command():
    lines = (ROOT / "README.md").read_text().splitlines()
    shown = {word.split()[0] for line in lines if line.startswith("| `acqd ") for word in line.split("`acqd ")[1:]}
    assert names(command_tree()) <= {word.strip("`,") for word in shown}


def test_help_fits_a_terminal_and_is_in_the_order_of_work():
    lines = acqd_here("--help").stdout.splitlines()
    assert len(lines) < 24 and max(map(len, lines[3:])) <= 80  # the others have the name of the program
    shown = [line[at : at + 12].strip() for line in lines[3:] for at in (8, 44)]
    assert sorted(filter(None, shown)) == sorted(names(command_tree()))
    steps = [line[:8].strip() for line in lines[3:] if line[0] != " "]
    assert steps == ["set up", "measure", "count", "record", "model", "explain", "hand on"]


def options(command, path="acqd"):
    """Every option that starts with --, by command."""
    yield from ((path, p) for p in command.params if p.param_type_name == "option")
    for name, each in getattr(command, "commands", {}).items():
        yield from options(each, f"{path} {name}")


def test_times_have_one_name():
    found = list(options(typer.main.get_command(command_tree())))
    assert len(found) > 300
    other = {"--since", "--until", "--begin", "--end", "--after", "--before", "--stop"}
    assert [(path, one.opts) for path, one in found if one.opts[0] in other] == []
    both = {path: {one.opts[0] for where, one in found if where == path} for path, _ in found}
    ends = [path for path, opts in both.items() if "--to" in opts]
    assert len(ends) >= 7 and all("--from" in both[path] for path in ends)


def test_options_that_commands_share_are_in_the_table_of_names():
    table = (ROOT / "CONTRIBUTING.md").read_text().partition("## Names of options")[2].partition("## Tests")[0]
    named = set(re.findall(r"^\| (.*?) \|", table, re.MULTILINE))
    named = {word for cell in named for word in re.findall(r"`(--[a-z-]+)`", cell)}
    users = defaultdict(set)
    for path, one in options(typer.main.get_command(command_tree())):
        if not one.hidden:
            users[one.opts[0]].add(path)
    shared = {name for name, paths in users.items() if len(paths) > 1}
    assert len(shared) > 40 and shared - named == set() and named - set(users) == set()


def test_help_keeps_its_brackets():
    texts = list(helps(typer.main.get_command(command_tree())))
    assert len(texts) > 200 and [text for text in texts if markup.render(text).plain != text] == []


@pytest.mark.parametrize(
    ("command", "unused"),
    [
        ("train", ["acqd.daemon", "acqd.telemetry", "pydantic", "sqlalchemy", "amqtt"]),
        ("watch", ["acqd.sources", "acqd.plc", "acqd.daemon.service", "sqlalchemy", "amqtt"]),
        ("sink", ["acqd.sources.comtrade", "acqd.daemon.service", "acqd.cli.run", "amqtt"]),
    ],
)
def test_a_command_imports_nothing_of_the_others(command, unused):
    script = f"import sys; from acqd.cli.commands import command_tree; command_tree([{command!r}]); print(*sys.modules)"
    done = subprocess.run([sys.executable, "-P", "-c", script], capture_output=True, text=True, check=True)
    imported = set(done.stdout.split())
    assert f"acqd.cli.{command}" in imported or f"acqd.cli.models.{command}" in imported
    assert not imported & set(unused)


def test_the_port_of_the_page_is_not_that_of_the_broker(tmp_path, monkeypatch):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        refusal = refused(acqd_here("web", "--database", tmp_path / "p.sqlite", "--web-port", port, cwd=tmp_path))
    assert f"page port 127.0.0.1:{port} cannot be used" in refusal and "with --web-port or [web] port" in refusal
    monkeypatch.setattr("acqd.web.server.Server.run", lambda self: None)
    (tmp_path / "acqd.toml").write_text(f"[web]\nport = {port}\n")
    told = "--port 1884 is that of the broker; --web-port is that of the page"
    asked = ("web", "--config", tmp_path / "acqd.toml", "--port", 1884)
    assert told in acqd_here(*asked).stderr and told not in acqd_here(*asked, "--web-port", port).stderr


def test_a_port_that_only_root_may_take_is_no_other_program(monkeypatch):
    def closed(self, address):
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(socket.socket, "bind", closed)
    with pytest.raises(UserError, match=r"page port 127.0.0.1:80: this user may not listen below 1024; .* with --web"):
        check_port("127.0.0.1", 80, "page", "--web-port")
