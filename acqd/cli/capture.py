"""`acqd capture`: a waveform snapshot of the running daemon, or a part of a recording."""

from __future__ import annotations

import math
import tempfile
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Annotated

import orjson
import typer

from acqd.atomic import require_new, require_writable, write_complete
from acqd.cli.options import ConfigFile, Json, configured
from acqd.daemon.health.capture import MOST_S, captured
from acqd.errors import InputError, UserError
from acqd.sources import ChannelMap, Waveform, load_waveform
from acqd.sources.comtrade.write import files_of, write_comtrade
from acqd.sources.npz_write import npz_bytes
from acqd.timestamps import rfc3339

_ENDINGS = (".npz", ".cff", ".cfg", ".dat")


def capture(
    out: Annotated[Path, typer.Option(help="File to write: .npz, or COMTRADE as .cff or .cfg (with .dat).")],
    file: Annotated[Path | None, typer.Argument(help="A recording; without one, the running daemon is asked.")] = None,
    seconds: Annotated[
        float | None,
        typer.Option(min=0.001, max=MOST_S, help="How much of the daemon's newest samples, in s (1 unless given)."),
    ] = None,
    device: Annotated[str, typer.Option(help="Which one of several sources of the daemon; needed there.")] = "",
    begin: Annotated[str | None, typer.Option("--from", help="Of a recording: s from its start, or UTC.")] = None,
    end: Annotated[str | None, typer.Option("--to", help="Of a recording: s from its start, or UTC.")] = None,
    mapping: Annotated[str | None, typer.Option("--map", help="Columns: u1=NAME,i1=NAME,...")] = None,
    rate: Annotated[float | None, typer.Option(min=1.0, help="Samples/s, where the file does not say.")] = None,
    u_scale: Annotated[float | None, typer.Option(min=1e-12, help="V per unit of the file.")] = None,
    i_scale: Annotated[float | None, typer.Option(min=1e-12, help="A per unit of the file.")] = None,
    config: ConfigFile = None,
    json: Json = False,
) -> None:
    """Write a piece of waveform to a file.

    Example: acqd capture --seconds 2 --out now.npz
    """
    if out.suffix.lower() not in _ENDINGS:
        raise UserError(f"--out {out}: expected a name that ends in {', '.join(_ENDINGS)}")
    if not out.parent.is_dir():
        raise UserError(f"--out {out}: folder {out.parent} does not exist; create it")
    require_writable(out)
    for path in files_of(out):
        require_new(path, "a capture")
    if file is None:
        if begin or end or mapping or rate or u_scale or i_scale:
            raise UserError(
                "--from, --to, --map, --rate and the scales are for a recording; name one, or leave them out"
            )
        waveform = _of_daemon(config, device, seconds or 1.0)
    else:
        if seconds is not None or device:
            raise UserError("--seconds and --device are for the running daemon; use --from and --to for a recording")
        columns = ChannelMap.parse(mapping) if mapping else None
        waveform = _part(file, load_waveform(file, ChannelMap(columns, u_scale, i_scale, rate)), begin, end)
    _write(out, waveform)
    start = None if waveform.start_utc_ns is None else rfc3339(waveform.start_utc_ns)
    report = {"file": str(out), "samples": len(waveform.codes), "seconds": waveform.duration, "start": start}
    print(orjson.dumps(report).decode() if json else f"{out}: {waveform.duration:g} s, {len(waveform.codes)} samples")


def _of_daemon(config: Path | None, device: str, seconds: float) -> Waveform:
    content = captured(configured(config).health, device, seconds)
    with tempfile.NamedTemporaryFile(suffix=".npz") as file:
        file.write(content)
        file.flush()
        return load_waveform(Path(file.name))


def _part(path: Path, waveform: Waveform, begin: str | None, end: str | None) -> Waveform:
    """From `begin` to `end`. Raises UserError for times that are not in the recording."""
    rate = waveform.form.rate
    first = 0 if begin is None else math.ceil(round(_seconds("--from", waveform, begin) * rate, 6))
    last = len(waveform.codes) if end is None else math.ceil(round(_seconds("--to", waveform, end) * rate, 6))
    if not 0 <= first < last <= len(waveform.codes):
        raise InputError(
            path,
            f"has 0 .. {waveform.duration:g} s; --from {begin or 0} --to {end or f'{waveform.duration:g}'} is no part",
        )
    start = None if waveform.start_utc_ns is None else waveform.start_utc_ns + round(first * 1e9 / rate)
    return replace(waveform, codes=waveform.codes[first:last], start_utc_ns=start)


def _seconds(option: str, waveform: Waveform, text: str) -> float:
    """s since the start of the recording."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if math.isfinite(value):
        return value
    try:
        stamp = datetime.fromisoformat(text)
    except ValueError:
        raise UserError(f"{option} {text!r}: expected seconds, or a time like 2021-07-13T10:15:00Z") from None
    if waveform.start_utc_ns is None:
        raise UserError(f"{option} {text!r}: the recording does not say when it begins; give seconds")
    since = (stamp if stamp.tzinfo else stamp.replace(tzinfo=UTC)) - datetime(1970, 1, 1, tzinfo=UTC)
    return (since // timedelta(microseconds=1) * 1000 - waveform.start_utc_ns) * 1e-9


def _write(out: Path, waveform: Waveform) -> None:
    if out.suffix.lower() == ".npz":
        write_complete(out, npz_bytes(waveform))
    else:
        write_comtrade(out, waveform)
