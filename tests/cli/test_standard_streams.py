"""Output that is closed, full, or read by nobody: real processes below a real shell."""

import shlex
import subprocess

import pytest

from tests.commands import ACQD

COMMANDS = ("robot list", "robot list --json", "--help")


def shell(script, unbuffered):
    """Exit status and stderr of a line of bash; ACQD in it is the program."""
    line = script.replace("ACQD", shlex.join(ACQD))
    done = subprocess.run(["bash", "-c", f"export PYTHONUNBUFFERED={unbuffered}; {line}"], capture_output=True,
                          text=True, check=False)  # fmt: skip
    return done.returncode, done.stderr


@pytest.mark.parametrize(("command", "unbuffered"), [*((each, "") for each in COMMANDS), ("--version", "1")])
def test_output_that_nobody_takes_ends_with_one_line_and_2(command, unbuffered):
    for where, words in ((">&-", "standard output is closed"), (">/dev/full", "standard output: No space left")):
        code, said = shell(f"ACQD {command} {where}", unbuffered)
        assert code == 2 and said.startswith(f"acqd: {words}") and said.count("\n") == 1, (where, said)


@pytest.mark.parametrize("command", COMMANDS)
def test_a_reader_that_has_gone_ends_the_command_as_sigpipe_would(command):
    """The pipe is open until the reader has ended, so that no output fits into it before."""
    code, said = shell(f"exec 3> >(:); wait $!; ACQD {command} >&3", "")
    assert (code, said) == (141, "")


def test_without_standard_error_the_exit_code_remains_and_nothing_comes_elsewhere():
    for where in ("2>&-", "2>/dev/full"):
        done = subprocess.run(["bash", "-c", f"{shlex.join(ACQD)} nosuch {where}"], capture_output=True, check=False)
        assert (done.returncode, done.stdout) == (2, b""), where


def test_a_closed_standard_output_is_no_reason_to_fail_where_nothing_is_printed(tmp_path):
    code, said = shell("ACQD robot list --nosuch >&-", "")
    assert code == 2 and "--nosuch" in said and "standard output" not in said
