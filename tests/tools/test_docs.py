"""The generated references, the man pages and the site."""

import inspect
import shutil
import subprocess

import pytest
import typer.main

import acqd
from acqd.cli.commands import command_tree
from tests.places import ROOT
from tools.docs.commands import all_commands
from tools.docs.manpages import write_man_pages
from tools.docs.reference import api, commands
from tools.docs.report_keys import KEYS
from tools.docs.site import build_site, lay_out


def leaves(command, words):
    """Commands without commands below them."""
    children = getattr(command, "commands", None)
    if not children:
        return [words]
    return [leaf for name, child in children.items() for leaf in leaves(child, f"{words} {name}")]


def test_every_command_is_in_the_reference():
    text = commands()
    tree = typer.main.get_command(command_tree())
    for words in leaves(tree, "acqd"):
        assert f"### {words}\n" in text
    assert "### acqd sink\n" in text and text.count("\n## ") == len({command.panel for command in all_commands()})
    close = next(command for command in all_commands() if command.name == "acqd close-loop")
    assert close.usage == "acqd close-loop [OPTIONS] DS" and close.examples[0].startswith("acqd close-loop ")
    assert {"--model PATH", "--seed INT"} <= {parameter.name for parameter in close.parameters}


def test_every_public_name_is_in_the_reference():
    text = api()
    for name in acqd.__all__:
        assert f"## {name}\n" in text or name == "__version__"
        value = getattr(acqd, name)
        assert name == "__version__" or inspect.getdoc(value), name


def test_the_reference_of_the_report_names_its_keys(closed):
    report = closed[1]
    assert {key for key in KEYS if "." not in key and "[" not in key} == set(report) - {"out"}
    assert {key.partition(".")[2] for key in KEYS if key.startswith("effects[]")} == set(report["effects"][0])


def test_man_pages_are_read_by_man(tmp_path):
    pages = write_man_pages(tmp_path)
    assert len(pages) == len(all_commands()) + 1
    if shutil.which("mandoc") is None and shutil.which("groff") is None:
        pytest.skip("neither mandoc nor groff is installed")
    for page in pages:
        command = ["groff", "-man", "-Tutf8", "-ww", page] if shutil.which("groff") else ["mandoc", "-Tlint", page]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        assert not done.stderr, done.stderr


def test_pages_link_to_pages_that_exist(tmp_path):
    lay_out(tmp_path / "docs")
    assert (tmp_path / "docs" / "index.md").read_text().count("](") > 10
    for path in (tmp_path / "docs").rglob("*.md"):
        assert "](../config" not in path.read_text() and "](docs/" not in path.read_text(), path


def test_the_site_builds_without_warnings(tmp_path):
    pytest.importorskip("mkdocs", reason="MkDocs is not installed: pip install 'acqd[docs]'")
    pytest.importorskip("material")
    build_site(tmp_path / "site")
    assert "close-loop" in (tmp_path / "site" / "reference" / "commands.html").read_text()


def test_the_next_version_is_described_in_a_page_that_users_read():
    """The rules of CONTRIBUTING.md: few lines, by kind, what users have to act on first."""
    text = (ROOT / "CHANGELOG.md").read_text()
    unreleased = text.split("\n## ")[1]
    parts = [line.removeprefix("### ") for line in unreleased.splitlines() if line.startswith("### ")]
    order = ["When you upgrade", "Added", "Changed", "Fixed"]
    assert unreleased.startswith("Unreleased\n") and parts == [part for part in order if part in parts]
    assert len(unreleased.splitlines()) <= 100
    long = [entry for entry in unreleased.split("\n- ")[1:] if len(entry.split("\n\n")[0].splitlines()) > 3]
    assert not long
