"""`acqd archive`: what is kept of the samples, whether it is unharmed, and files of other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import orjson
import typer

from acqd.archive.catalogue import Contents, Gap, contents
from acqd.archive.export import stretches, written
from acqd.archive.verify import Checked, verified
from acqd.atomic import require_new
from acqd.cli.folded_table import Table
from acqd.cli.options import ConfigFile, Json, config_file, utc_option
from acqd.cli.terminal import terminal
from acqd.daemon.archive.replay import chosen
from acqd.daemon.config_file import load_config
from acqd.errors import OperationError, UserError
from acqd.report.digits import percent, quantity
from acqd.sources.comtrade.write import files_of
from acqd.timestamps import rfc3339

app = typer.Typer(no_args_is_help=True, help="Samples that a daemon has kept: list, check, export.")
Folder = Annotated[Path | None, typer.Argument(metavar="[DIR]", help="The archive; or give --config.")]
Device = Annotated[str | None, typer.Option(help="Only this device.")]
From = Annotated[str | None, typer.Option("--from", help="UTC, such as 2026-12-31T23:15:00Z.")]
To = Annotated[str | None, typer.Option("--to", help="UTC of the end.")]


def place_of(folder: Path | None, config: Path | None) -> Path:
    """Folder of the archive that a command means. Raises UserError."""
    if folder is not None:
        return folder
    config = config_file(config)
    if config is None:
        raise UserError("which archive? Give its folder, or --config FILE")
    loaded = load_config(config)
    place = loaded.archive.place(loaded.state_dir, loaded.device)
    if place is None:
        raise UserError(f"{config}: neither [archive] folder nor state_dir is set")
    if not loaded.archive.enabled and not place.exists():
        raise UserError(f"{config}: no samples are kept, [archive] enabled is false, and {place} does not exist")
    return place


def _contents_of(
    folder: Path | None, config: Path | None, device: str | None, since: str | None, until: str | None
) -> Contents:
    """What the archive holds of a device between two times. Raises UserError."""
    begin, end = utc_option("--from", since), utc_option("--to", until)
    return contents(place_of(folder, config), device, begin, end)


@app.command("list")
def list_(
    folder: Folder = None,
    device: Device = None,
    since: From = None,
    until: To = None,
    config: ConfigFile = None,
    json: Json = False,
) -> None:
    """Segments in order, and every gap with its reason.

    Example: acqd archive list /var/lib/acqd/archive-box --from 2026-12-31T22:00:00Z
    """
    there = _contents_of(folder, config, device, since, until)
    if json:
        print(orjson.dumps(_as_json(there)).decode())
        return
    console = terminal(tables=True)
    table = Table("device", "file", "from", "until", "samples", "MB", "of raw", "ended")
    for segment in there.segments:
        head = segment.head
        raw = segment.samples * len(head.origin.form.scale) * head.origin.form.dtype.itemsize
        table.add_row(
            head.origin.device, segment.path.name, rfc3339(segment.begin_ns, 3), rfc3339(segment.end_ns, 3),
            str(segment.samples), f"{segment.size / 1e6:.2f}", percent(segment.size / raw) if raw else "-",
            segment.why or "not yet",
        )  # fmt: skip
    console.print(table)
    _print_gaps(there.gaps())
    for line in there.unreadable:
        console.print(f"unreadable: {line}")
    size = sum(segment.size for segment in there.segments)
    seconds = sum(segment.seconds for segment in there.segments)
    console.print(
        f"{len(there.segments)} segments, {seconds:.1f} s of samples, {quantity(size, 'B', 3)}"
        + (f", {size / seconds * 86_400 / 1e9:.2f} GB a day" if seconds else "")
    )


@app.command()
def verify(
    folder: Folder = None,
    device: Device = None,
    since: From = None,
    until: To = None,
    config: ConfigFile = None,
    json: Json = False,
) -> None:
    """Read every sample and compare checksums and counts; exit code 1 where something is damaged.

    Example: acqd archive verify --config /etc/acqd/acqd.toml
    """
    there = _contents_of(folder, config, device, since, until)
    checks = [verified(segment) for segment in there.segments]
    bad = [check for check in checks if check.faults]
    if json:
        gaps = [gap_json(gap) for gap in there.gaps()]
        print(orjson.dumps({"segments": checks, "unreadable": there.unreadable, "gaps": gaps}).decode())
    else:
        _print_checks(checks, there)
    if bad or there.unreadable:
        raise OperationError(f"{len(bad) + len(there.unreadable)} of {len(checks)} files are damaged")


@app.command()
def export(
    out: Annotated[Path, typer.Option(help="Name that ends in .npz, .csv, .wav, .cff or .cfg (COMTRADE).")],
    folder: Folder = None,
    since: From = None,
    until: To = None,
    device: Device = None,
    config: ConfigFile = None,
    json: Json = False,
) -> None:
    """Write samples as the source delivered them; a second file, NAME-2, begins where samples are missing.

    Example: acqd archive export DIR --from 2026-12-31T23:15:00Z --to 2026-12-31T23:15:10Z --out dip.npz
    """
    begin, end = utc_option("--from", since), utc_option("--to", until)
    there = chosen(place_of(folder, config), device, begin, end)
    for path in (file for name in (out, out.with_stem(f"{out.stem}-2")) for file in files_of(name)):
        require_new(path, "an export")
    told: list[dict[str, Any]] = []
    for number, waveform in enumerate(stretches(there, begin, end), start=1):
        path = out if number == 1 else out.with_stem(f"{out.stem}-{number}")
        files = written(waveform, path, there.devices[0])
        told.append(
            {
                "files": [str(file) for file in files],
                "from": waveform.name,
                "samples": len(waveform.codes),
                "scale": list(waveform.form.scale),
                "rate": waveform.form.rate,
            }
        )
    if not told:
        raise UserError("no sample lies between --from and --to; acqd archive list shows what there is")
    if json:
        print(orjson.dumps({"device": there.devices[0], "stretches": told}).decode())
        return
    console = terminal()
    for one in told:
        console.print(f"{', '.join(one['files'])}: {one['samples']} samples at {one['rate']:g} Hz from {one['from']}")
    if out.suffix.lower() == ".wav":
        console.print(f"V and A per code, in the order of the channels: {told[0]['scale']}")


def _as_json(there: Contents) -> dict[str, Any]:
    return {
        "segments": [
            {
                "device": segment.head.origin.device,
                "file": str(segment.path),
                "number": segment.head.number,
                "boot": segment.head.boot,
                "from": rfc3339(segment.begin_ns),
                "until": rfc3339(segment.end_ns),
                "samples": segment.samples,
                "rate": segment.head.origin.form.rate,
                "bytes": segment.size,
                "ended": segment.why,
                "damaged_bytes": segment.damaged,
                "torn_bytes": segment.torn,
            }
            for segment in there.segments
        ],
        "gaps": [gap_json(gap) for gap in there.gaps()],
        "unreadable": list(there.unreadable),
    }


def gap_json(gap: Gap) -> dict[str, Any]:
    """For --json."""
    return {
        "device": gap.device, "from": rfc3339(gap.begin_ns), "until": rfc3339(gap.end_ns), "samples": gap.samples,
        "why": gap.why,
    }  # fmt: skip


def _print_gaps(gaps: list[Gap]) -> None:
    console = terminal(tables=True)
    for gap in gaps:
        lasts = (gap.end_ns - gap.begin_ns) / 1e9
        many = f", {gap.samples} samples" if gap.samples is not None else ""
        console.print(f"gap of {gap.device}: {rfc3339(gap.begin_ns, 3)}, {lasts:.3f} s{many}: {gap.why}")


def _print_checks(checks: list[Checked], there: Contents) -> None:
    console = terminal(tables=True)
    for check in checks:
        for fault in check.faults:
            console.print(f"damaged: {check.file}: {fault}")
    for line in there.unreadable:
        console.print(f"unreadable: {line}")
    _print_gaps(there.gaps())
    samples = sum(check.samples for check in checks)
    console.print(f"{len(checks)} segments, {samples} samples read, {sum(not c.faults for c in checks)} unharmed")
