"""The command tree, and the only place where errors become exit codes."""

from __future__ import annotations

import logging
import os
import sys
from collections.abc import Callable
from typing import NoReturn

import typer

from acqd.cli import (
    broker,
    close_loop,
    dataset,
    doctor,
    ethercat,
    export_fmu,
    jitter,
    lab,
    modbus,
    models,
    replay,
    robot,
    run,
    sidecar,
    sink,
    status,
    watch,
)
from acqd.errors import OperationError, UserError

app = typer.Typer(
    help="Energy twin measurement chain: 20 kHz samples in, trustworthy power rows out.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)
app.command("run")(run.run)
app.command("replay")(replay.replay)
app.add_typer(sink.app, name="sink")
app.command("status")(status.status)
app.command("watch")(watch.watch)
app.command("doctor")(doctor.doctor)
app.command("jitter")(jitter.jitter)
app.command("broker")(broker.broker)
app.add_typer(ethercat.app, name="ethercat")
app.add_typer(modbus.app, name="modbus")
app.add_typer(robot.app, name="robot")
app.add_typer(lab.app, name="lab")
app.add_typer(dataset.app, name="dataset")
app.command("train")(models.train)
app.command("compare")(models.compare)
app.command("predict")(models.predict)
app.command("close-loop")(close_loop.close_loop)
app.command("export-fmu")(export_fmu.export_fmu)
app.command("sidecar")(sidecar.sidecar)

_JOURNAL_LEVEL = {logging.DEBUG: 7, logging.INFO: 6, logging.WARNING: 4, logging.ERROR: 3, logging.CRITICAL: 2}


class _Lines(logging.Formatter):
    """One line per record; with systemd's priority prefix when the journal reads them."""

    def format(self, record: logging.LogRecord) -> str:
        text = super().format(record)
        if "JOURNAL_STREAM" in os.environ:
            return f"<{_JOURNAL_LEVEL.get(record.levelno, 6)}>{text}"
        return f"acqd: {record.levelname.lower()}: {text}" if record.levelno > logging.INFO else f"acqd: {text}"


def _end_quietly() -> NoReturn:
    """Exit with 0: the reader of our output has gone (acqd replay ... | head), and nothing is wrong."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    sys.exit(0)


def main() -> None:
    """Run the command line."""
    for_people(app)


def for_people(work: Callable[[], object]) -> None:
    """Run `work`; errors become one line and an exit code: 0 ok, 1 failure, 2 bad input or usage, 130 interrupted."""
    handler = logging.StreamHandler()
    handler.setFormatter(_Lines())
    logging.basicConfig(level=logging.INFO, handlers=[handler])
    logging.getLogger("alembic").setLevel(logging.WARNING)
    logging.getLogger("mqtt").setLevel(logging.ERROR)
    try:
        work()
    except UserError as error:
        print(f"acqd: {error}", file=sys.stderr)
        sys.exit(2)
    except OperationError as error:
        print(f"acqd: {error}", file=sys.stderr)
        sys.exit(1)
    except OSError as error:
        if isinstance(error, BrokenPipeError):
            _end_quietly()
        where = f"{error.filename}: " if error.filename else ""
        print(f"acqd: {where}{error.strerror or error}", file=sys.stderr)
        sys.exit(1)
    except KeyboardInterrupt:
        sys.exit(130)
