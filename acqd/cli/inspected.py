"""Prints what `acqd replay --inspect` has learned of a file."""

from __future__ import annotations

from datetime import UTC, datetime

import orjson

from acqd.cli.folded_table import Table
from acqd.cli.phasor_diagram import diagram, lines
from acqd.cli.terminal import terminal
from acqd.sources.recording.inspect import Inspected


def print_inspected(files: list[Inspected], *, json: bool) -> None:
    """A table of channels per file, or one JSON document."""
    if json:
        print(orjson.dumps(files if len(files) > 1 else files[0]).decode())
        return
    console = terminal(tables=True)
    for one in files:
        table = Table("", "name", "unit", "is", "metered as", "mean", "RMS", "first readings", "because")
        table.title, table.title_justify = f"{one.file}: {one.format}", "left"
        for channel in one.channels:
            numbers = ["-" if value is None else f"{value:.5g}" for value in (channel.mean, channel.rms)]
            first = " ".join(f"{value:.5g}" for value in channel.first)
            table.add_row(
                str(channel.number), channel.name, channel.unit, channel.role, channel.key, *numbers, first,
                ", ".join(channel.evidence),
            )  # fmt: skip
        console.print(table)
        rate = f"{one.rate:.6g} samples/s" if one.rate else "sampling rate unknown: --rate"
        start = (
            "no date"
            if one.start_utc_ns is None
            else f"{datetime.fromtimestamp(one.start_utc_ns * 1e-9, UTC):%Y-%m-%d %H:%M:%S} UTC"
        )
        length = f", {one.samples / one.rate:.3g} s" if one.rate else ""
        console.print(f"{one.samples} samples, {rate}{length}, {start}")
        for note in one.notes:
            console.print(f"note: {note}")
        if one.phasors:
            console.print(diagram(one.phasors), highlight=False)
            for line in lines(one.phasors):
                console.print(line, highlight=False)
        for finding in one.wiring:
            console.print(f"wiring: {finding}")
        console.print(f"cannot be metered as it is: {one.refusal}" if one.refusal else "can be metered")
        console.print(one.map)
