"""Mistakes on the command line: one line, exit code 2, without a frame around it."""

from __future__ import annotations

import pytest

from acqd.cli.commands import command_tree
from acqd.cli.main import for_people

MISTAKES = {
    (
        "jitter",
        "--duration",
        "-3",
    ): "jitter: --duration: expected a number greater than or equal to 0.5; see acqd jitter --help",
    ("plan", "many"): "plan: N: expected a whole number; see acqd plan --help",
    ("plan", "3", "4"): "plan: unexpected extra argument(s) (4); see acqd plan --help",
    ("energy", "--bye", "day"): "energy: no such option: --bye",
    ("plan", "-5"): "plan: -5: expected a number that is not negative",
    ("energy", "--by"): "energy: --by: expected an argument after the option; see acqd energy --help",
    ("sink", "quarantine", "list", "--limit"): "sink quarantine list: ",
    ("replay", "--mode", "square", "x.npz"): "replay: --mode: 'square': expected 'synchronous', 'fixed'; see acqd rep",
    ("archive", "verify", "--config"): "archive verify: --config: expected an argument after the option; see acqd a",
    ("train",): "train: missing argument 'DS'; see acqd train --help",
    ("archive", "nosuch"): "archive: no such command 'nosuch'; see acqd archive --help",
    ("energi",): "no such command 'energi' (did you mean 'energy'",
}


@pytest.mark.parametrize("words", MISTAKES)
def test_a_command_line_that_cannot_be_understood_is_answered_in_one_line(words, capfd):
    with pytest.raises(SystemExit) as end:
        for_people(lambda: command_tree(words)(list(words), prog_name="acqd", standalone_mode=False))
    said = capfd.readouterr().err
    assert end.value.code == 2 and said.startswith(f"acqd: {MISTAKES[words]}") and said.count("\n") == 1


def test_a_group_without_a_command_shows_its_help(capfd):
    with pytest.raises(SystemExit) as end:
        for_people(lambda: command_tree(["archive"])(["archive"], prog_name="acqd", standalone_mode=False))
    assert end.value.code == 2 and "verify" in "".join(capfd.readouterr())
