"""`acqd replay`: meters recorded waveforms."""

from __future__ import annotations

import signal
import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import orjson
import typer
from rich.progress import Progress

from acqd.cli.folded_table import Table
from acqd.cli.inspected import print_inspected
from acqd.cli.options import ConfigFile, Host, Json, Port, broker_address, utc_option
from acqd.cli.table import energy
from acqd.cli.terminal import terminal
from acqd.daemon.events.of_recording import event_settings
from acqd.daemon.playback import Playback, play
from acqd.daemon.playback_report import PlaybackReport
from acqd.daemon.quality_section import QualitySection
from acqd.errors import UserError
from acqd.report.digits import quantity
from acqd.sources import ChannelMap
from acqd.sources.load import load_recording
from acqd.sources.recording.inspect import inspect as inspected
from acqd.sources.text_file import check_encoding
from acqd.telemetry.topics import valid_device

_DEVICE = "replay"
_OF_AN_ARCHIVE = ("archive", "since", "until", "against", "out", "device", "json")
"""Parameters that go with --archive."""


class Speed(StrEnum):
    """Playback speed."""

    MAX = "max"
    REAL = "1"


class ModeName(StrEnum):
    """Metering mode."""

    SYNCHRONOUS = "synchronous"
    FIXED = "fixed"


class Lamp(StrEnum):
    """Lamp of the flickermeter."""

    V230 = "230V"
    V120 = "120V"


def replay(
    context: typer.Context,
    files: Annotated[
        list[Path] | None, typer.Argument(metavar="FILE...", help="Files of instruments: docs/waveforms.md lists them.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Write the rows as JSON lines; - is stdout.")] = None,
    speed: Annotated[Speed, typer.Option(help="As fast as possible, or in real time.")] = Speed.MAX,
    mode: Annotated[ModeName, typer.Option(help="Whole mains cycles, or exactly each window.")] = ModeName.SYNCHRONOUS,
    publish: Annotated[bool, typer.Option("--publish", help="Publish the rows over MQTT.")] = False,
    aggregate: Annotated[Path | None, typer.Option(help="Write 10/12-cycle values (IEC 61000-4-30).")] = None,
    quality: Annotated[Path | None, typer.Option(help="Write power quality as JSON lines (docs/quality.md).")] = None,
    harmonic_powers: Annotated[
        bool, typer.Option("--harmonic-powers", help="With --quality: angles and active powers of the harmonics.")
    ] = False,
    lines: Annotated[bool, typer.Option("--lines", help="With --quality: each line of 5 Hz up to 100 Hz.")] = False,
    bands: Annotated[
        bool, typer.Option("--bands", help="With --quality: bands of 200 Hz and 1 kHz from 2 to 9 kHz.")
    ] = False,
    signalling_hz: Annotated[
        float | None, typer.Option(min=110, max=2450, help="With --quality: carrier of mains signalling in Hz (V_ms).")
    ] = None,
    signalling_threshold: Annotated[
        float | None, typer.Option(min=0.3, max=15, help="% of the nominal voltage: V_ms above it is a telegram.")
    ] = None,
    events: Annotated[Path | None, typer.Option(help="Write dips, swells, interruptions as JSON lines.")] = None,
    declared_voltage: Annotated[
        str | None, typer.Option(help="100 % of the events: V, or sliding (it follows the voltage).")
    ] = None,
    thresholds: Annotated[
        str | None,
        typer.Option(help="Of events in %: dip=90,swell=110,interruption=5,hysteresis=2,rapid_change=5,transient=0."),
    ] = None,
    line_to_line: Annotated[
        bool, typer.Option("--line-to-line", help="Of events: watch the voltages between the lines.")
    ] = False,
    flicker: Annotated[Path | None, typer.Option(help="Write Pst and Plt (IEC 61000-4-15) as JSON lines.")] = None,
    lamp: Annotated[Lamp, typer.Option(help="Of --flicker.")] = Lamp.V230,
    phasors: Annotated[Path | None, typer.Option(help="Write synchrophasors, f and ROCOF as JSON lines.")] = None,
    half_cycles: Annotated[Path | None, typer.Option(help="Write Urms(1/2) of every half cycle as JSON lines.")] = None,
    device: Annotated[str, typer.Option(help="Device name in the rows.")] = _DEVICE,
    loops: Annotated[int, typer.Option("--loops", "--loop", min=1, help="Play each file so many times.")] = 1,
    window: Annotated[float, typer.Option(min=0.04, max=0.05, help="Window length in s.")] = 0.04,
    nominal_voltage: Annotated[float, typer.Option(min=0.01, help="V, for the no_mains threshold.")] = 230.0,
    start: Annotated[str | None, typer.Option(help="UTC of the first sample where the file has none.")] = None,
    mapping: Annotated[str | None, typer.Option("--map", help="Columns: u1=NAME,i1=NAME,...")] = None,
    u_scale: Annotated[float | None, typer.Option(help="V per unit of the file (sound: V at full scale).")] = None,
    i_scale: Annotated[float | None, typer.Option(help="A per unit of the file (sound: A at full scale).")] = None,
    rate: Annotated[float | None, typer.Option(help="Samples/s, where the file does not say.")] = None,
    f_nominal: Annotated[float | None, typer.Option(help="Nominal mains frequency in Hz.")] = None,
    encoding: Annotated[str | None, typer.Option(help="Of CSV and COMTRADE text, such as latin-1.")] = None,
    layout: Annotated[str | None, typer.Option(help="Of a text export: a name, or a .toml of your own.")] = None,
    inspect: Annotated[
        bool, typer.Option("--inspect", help="Show channels and first readings; meter nothing.")
    ] = False,
    archive: Annotated[
        Path | None, typer.Option(help="Instead of files: the archive of a daemon, metered as the daemon did.")
    ] = None,
    since: Annotated[str | None, typer.Option("--from", help="With --archive: UTC of the first row.")] = None,
    until: Annotated[str | None, typer.Option("--to", help="With --archive: UTC after the last row.")] = None,
    against: Annotated[
        str | None, typer.Option(help="With --archive: compare with stored rows (.jsonl, .sqlite or SQL URL).")
    ] = None,
    config: ConfigFile = None,
    host: Host = None,
    port: Port = None,
    json: Json = False,
) -> None:
    """Meter recorded waveforms, or the samples that a daemon has kept.

    Example: acqd replay recording.npz --out rows.jsonl; acqd replay --inspect relay.cfg; acqd replay --archive DIR
    --from 2026-12-31T23:00:00Z --to 2027-01-01T00:00:00Z --against acqd.sqlite
    """
    if archive is not None:
        from acqd.cli.replay_archive import ArchiveOptions, replay_archive  # with libsndfile, for this only

        _refuse_others(context)
        chosen = None if device == _DEVICE else device
        replay_archive(ArchiveOptions(archive, since, until, chosen, out, against), json=json)
        return
    files = _named(files, bool(since or until or against))
    if not valid_device(device):
        raise UserError(f"--device {device!r}: expected 1 to 64 letters, digits, dots, dashes or underscores")
    columns = ChannelMap.parse(mapping) if mapping else None
    for name, value in (("--u-scale", u_scale), ("--i-scale", i_scale), ("--rate", rate)):
        if value is not None and not 0 < value < 1e12:
            raise UserError(f"{name} {value:g}: expected a positive number")
    encoding = check_encoding(encoding) if encoding else None
    channels = ChannelMap(columns, u_scale, i_scale, rate, f_nominal, encoding, layout)
    if inspect:
        print_inspected([inspected(load_recording(path, channels), channels)[0] for path in files], json=json)
        return
    details = _quality_section(
        quality, harmonic_powers=harmonic_powers, lines=lines, bands=bands, signalling_hz=signalling_hz,
        signalling_threshold=signalling_threshold,
    )  # fmt: skip
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # an exception, so that the clean-up runs
    signal.signal(signal.SIGHUP, lambda *_: sys.exit(129))
    settings = Playback(
        files=files,
        channels=channels,
        device=device,
        mode=mode.value,
        window=window,
        nominal_voltage=nominal_voltage,
        loops=loops,
        real_time=speed is Speed.REAL,
        start_utc_ns=utc_option("--start", start),
        out=out,
        aggregate=aggregate,
        quality=quality,
        quality_section=details,
        events=event_settings(events, declared_voltage, thresholds, line_to_line=line_to_line),
        flicker=flicker,
        phasors=phasors,
        half_cycles=half_cycles,
        lamp=lamp.value,
        broker=broker_address(config, host, port) if publish else None,
    )
    console = terminal(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
        bar = progress.add_task("metering", total=1.0)
        report = play(settings, lambda share: progress.update(bar, completed=share))
    for note in report.notes:
        console.print(f"acqd: {note}")
    if out is not None and str(out) == "-":
        return
    if json:
        print(orjson.dumps(report).decode())
    else:
        _print(report)


def _named(files: list[Path] | None, of_archive: bool) -> list[Path]:
    """The files. Raises UserError where there are none, or options that only an archive has."""
    if not files:
        raise UserError("which recording? Give FILE..., or --archive DIR")
    if of_archive:
        raise UserError("--from, --to and --against are for --archive DIR; give that too")
    return files


def _refuse_others(context: typer.Context) -> None:
    """Raises UserError for an option that would be ignored: rows of an archive are made as the daemon made them."""
    for parameter in context.command.params:
        name = parameter.name or ""
        source = context.get_parameter_source(name)
        if source is not None and source.name == "COMMANDLINE" and name not in _OF_AN_ARCHIVE:
            given = parameter.opts[0] if parameter.opts[0].startswith("-") else "FILE"
            raise UserError(
                f"--archive makes rows as the daemon made them; leave {given} out "
                "(acqd archive export writes files for everything else)"
            )


def _print(report: PlaybackReport) -> None:
    console = terminal(tables=True)
    for file in dict.fromkeys(line.file for line in report.channels):
        table = Table("", "windows", "Vrms", "Irms", "P", "f", "W", "flagged")
        table.title, table.title_justify = file, "left"
        for line in (line for line in report.channels if line.file == file):
            cells = ((line.Vrms, "V"), (line.Irms, "A"), (line.P, "W"), (line.f, "Hz"))
            shown = [quantity(value, unit, 6 if unit == "Hz" else 5) for value, unit in cells]
            flagged = " ".join(f"{name}:{count}" for name, count in sorted(line.flagged.items()))
            table.add_row(line.channel, str(line.windows), *shown, energy(line.W), flagged)
        phases = [line for line in report.channels if line.file == file]
        if len(phases) > 1:
            P = sum(line.P for line in phases if line.P is not None)
            table.add_section()
            table.add_row("total", "", "-", "-", quantity(P, "W"), "-", energy(sum(line.W for line in phases)), "")
        console.print(table)
    console.print(
        f"{report.rows} rows from {report.recorded_s:.2f} s of waveform in {report.elapsed_s:.2f} s "
        f"({report.recorded_s / max(report.elapsed_s, 1e-9):.3g} x real time); "
        f"{report.unused_samples} samples after the last whole windows have no row"
        + (f"; {report.events} event{'s' if report.events > 1 else ''}" if report.events else "")
    )
    sys.stdout.flush()


def _quality_section(quality: Path | None, **details: bool | float | None) -> QualitySection:
    """What rows of power quality hold besides the usual. Raises UserError where there are no such rows."""
    for name, wanted in details.items():
        if wanted and quality is None:
            raise UserError(f"--{name.replace('_', '-')} belongs to rows of power quality; give --quality FILE too")
    if details["signalling_threshold"] is not None and details["signalling_hz"] is None:
        raise UserError("--signalling-threshold needs --signalling-hz, the carrier")
    return QualitySection.model_validate(details)
