"""The command tree, and the only place where errors become exit codes."""

from __future__ import annotations

import logging
import os
import sys
from collections.abc import Callable
from importlib import metadata
from typing import Annotated, NoReturn, TextIO

import typer

from acqd.cli import (
    alarms,
    bridge,
    broker,
    capture,
    close_loop,
    config,
    dataset,
    doctor,
    ethercat,
    export_fmu,
    export_onnx,
    fleet,
    jitter,
    lab,
    modbus,
    models,
    opcua,
    replay,
    robot,
    run,
    service,
    sidecar,
    sink,
    status,
    watch,
    web,
)
from acqd.errors import OperationError, UserError

app = typer.Typer(
    help="Energy twin measurement chain: 20 kHz samples in, trustworthy power rows out.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)
_MEASURE, _DATA, _MODELS, _SERVICE = "Measure", "Data", "Models", "Service"
app.command("run", rich_help_panel=_MEASURE)(run.run)
app.command("watch", rich_help_panel=_MEASURE)(watch.watch)
app.command("web", rich_help_panel=_MEASURE)(web.web)
app.command("replay", rich_help_panel=_MEASURE)(replay.replay)
app.command("capture", rich_help_panel=_MEASURE)(capture.capture)
app.add_typer(ethercat.app, name="ethercat", rich_help_panel=_MEASURE)
app.add_typer(modbus.app, name="modbus", rich_help_panel=_MEASURE)
app.add_typer(sink.app, name="sink", rich_help_panel=_DATA)
app.add_typer(lab.app, name="lab", rich_help_panel=_DATA)
app.add_typer(dataset.app, name="dataset", rich_help_panel=_DATA)
app.add_typer(robot.app, name="robot", rich_help_panel=_MODELS)
app.command("train", rich_help_panel=_MODELS)(models.train)
app.command("compare", rich_help_panel=_MODELS)(models.compare)
app.command("predict", rich_help_panel=_MODELS)(models.predict)
app.command("close-loop", rich_help_panel=_MODELS)(close_loop.close_loop)
app.command("fleet", rich_help_panel=_MODELS)(fleet.fleet)
app.command("export-fmu", rich_help_panel=_MODELS)(export_fmu.export_fmu)
app.command("export-onnx", rich_help_panel=_MODELS)(export_onnx.export_onnx)
app.command("sidecar", rich_help_panel=_MODELS)(sidecar.sidecar)
app.add_typer(config.app, name="config", rich_help_panel=_SERVICE)
app.add_typer(service.app, name="service", rich_help_panel=_SERVICE)
app.command("opcua", rich_help_panel=_SERVICE)(opcua.opcua)
app.command("status", rich_help_panel=_SERVICE)(status.status)
app.command("doctor", rich_help_panel=_SERVICE)(doctor.doctor)
app.command("jitter", rich_help_panel=_SERVICE)(jitter.jitter)
app.add_typer(alarms.app, name="alarms", rich_help_panel=_SERVICE)
app.add_typer(bridge.app, name="bridge", rich_help_panel=_SERVICE)
app.command("broker", rich_help_panel=_SERVICE)(broker.broker)


def _show_version(wanted: bool) -> None:
    if wanted:
        print(f"acqd {metadata.version('acqd')}")
        raise typer.Exit


@app.callback()
def _acqd(
    version: Annotated[
        bool, typer.Option("--version", help="Show the version.", callback=_show_version, is_eager=True)
    ] = False,
) -> None:
    """Energy twin measurement chain: 20 kHz samples in, trustworthy power rows out."""


_JOURNAL_LEVEL = {logging.DEBUG: 7, logging.INFO: 6, logging.WARNING: 4, logging.ERROR: 3, logging.CRITICAL: 2}


class _Stderr(logging.StreamHandler[TextIO]):
    """Writes to the stderr of the moment: a live table redirects it, so that lines go above the table."""

    @property
    def stream(self) -> TextIO:
        """As it is now."""
        return sys.stderr

    @stream.setter
    def stream(self, _: TextIO) -> None:
        """Ignore what the constructor sets."""


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
    handler = _Stderr()
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
