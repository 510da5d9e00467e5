"""Text exports as recordings: the table, its channels, its clock."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

from acqd.errors import InputError
from acqd.sources.recording.build import select
from acqd.sources.recording.channel import Column, Recording
from acqd.sources.recording.siblings import SAME_STEP, channel_number, siblings, skew
from acqd.sources.text.export import Export
from acqd.sources.text.layout import Layout, find_layout, recognised
from acqd.sources.text.lines import Text
from acqd.sources.text.rows import Rows
from acqd.sources.text.table import Table, are_units_alone, find_table, is_number, split_row
from acqd.sources.text_file import encoding_of
from acqd.sources.waveform import ChannelMap

_THOUSANDS = re.compile(r"[+-]?\d{1,3}(?:([.,'’ \u00a0\u202f])\d{3})+(?!\1)[.,]\d+")


def load(path: Path, given: ChannelMap) -> Recording:
    """A table of numbers with names above it, by its layout; of one channel, with those of the same shot beside it.

    Raises InputError.
    """
    first = _read(path, given)
    others = siblings(path) if first.lone is not None else []
    return _together(first, others, given) if others else first.recorded


def _together(first: Export, others: list[Path], given: ChannelMap) -> Recording:
    """One recording of files with one channel each."""
    recording, path = first.recorded, first.rows.text.path
    step_s = 1 / recording.rate if recording.rate else 0.0
    taken, notes, left_out = [(path, first)], list(recording.notes), list[str]()
    for other in others:
        try:
            export = _read(other, given)
        except InputError as error:
            left_out.append(f"left out: {error}")
            continue
        rates = export.recorded.rate or 1.0, recording.rate or 1.0
        same = abs(rates[0] / rates[1] - 1) < SAME_STEP and export.recorded.samples == recording.samples
        if export.lone is None or not same:
            left_out.append(f"{other.name} has another length or rate: left out")
            continue
        taken.append((other, export))
    notes += left_out
    if len(taken) == 1:
        return replace(recording, notes=notes, advice="; ".join([*left_out, *filter(None, [recording.advice])]))
    notes.append(f"read together with it: {', '.join(other.name for other, _ in taken[1:])}")
    taken.sort(key=lambda one: one[0].name)
    lone = [(export, export.lone or 0) for _, export in taken]
    own = [export.recorded.channels[k] for export, k in lone]
    if are_units_alone([channel.name for channel in own]):
        own = [replace(channel, name="", unit=channel.name) for channel in own]
    unique = len({channel.name for channel in own}) == len(own)
    channels = [
        replace(
            channel,
            name=channel.name if unique else f"CH{channel_number(other)}",
            skew_s=skew(export.begin_s - taken[0][1].begin_s, step_s),
        )
        for channel, (other, export) in zip(own, taken, strict=True)
    ]

    def column(k: int) -> Column:
        export, channel = lone[k]
        return export.column(channel)

    start = taken[0][1].recorded.start_utc_ns
    return replace(
        recording, channels=channels, column=column, notes=notes, start_utc_ns=start, advice="; ".join(left_out)
    )


def _read(path: Path, given: ChannelMap) -> Export:
    """One file, with what is read of it. Raises InputError."""
    text = Text(path, given.encoding or encoding_of(path))
    head = text.head()
    layout = find_layout(given.layout) if given.layout else recognised(head[:60])
    table = find_table(head, layout)
    if table is None:
        raise InputError(path, _no_table(head, layout))
    if grouped := next((name for name in table.names if _THOUSANDS.fullmatch(name)), None):
        raise InputError(path, f"has separators of thousands ({grouped}); export numbers without them")
    export = Export(Rows(text, layout, table, head))
    if not given.columns and (cut := _cut_by_commas(table, head)):
        raise InputError(path, cut)
    if not any(table.names) and not (given.columns and all(name.isdigit() for name in given.columns.values())):
        raise InputError(
            path,
            f"row {table.first or 1} has no names; expected a header like time,u1,i1, or columns by "
            "number: --map u1=1,i1=2",
        )
    recording = export.recorded = export.recording()
    refusal: InputError | None = None
    needed: list[int] = []
    try:
        needed = [channel for _, channel in select(recording, given).keys]
    except InputError as error:
        refusal = error  # raised again by whoever makes a waveform of the recording
    try:
        export.read(recording, needed, given)
    except InputError as error:
        raise (refusal or error) from None
    return export


def _no_table(head: list[str], layout: Layout) -> str:
    """Why there is nothing to meter."""
    if len([line for line in head if line.strip()]) == 1:
        return "has a header but no samples"
    known = f" (looks like {layout.title})" if layout.recognise else ""
    advice = f": {layout.advice}" if layout.advice else ""
    separator = next((d for d in ";\t," if d in head[-1]), ",")
    all_fields = (field for line in head for field in split_row(line, separator))
    if grouped := next((field for field in all_fields if _THOUSANDS.fullmatch(field)), None):
        return f"has separators of thousands ({grouped}); export numbers without them"
    for number, line in enumerate(head[1:], start=2):
        fields = split_row(line, next((d for d in ";\t," if d in head[0]), ","))
        faults = [[k for k, one in enumerate(fields) if one and not is_number(one, decimal)] for decimal in ".,"]
        fewest = min(faults, key=len)
        bad = fewest[0] if fewest else None
        if len(fields) == len(split_row(head[0], next((d for d in ";\t," if d in head[0]), ","))) and bad is not None:
            return (
                f"row {number}, column {bad + 1}: {fields[bad]!r} is not a number; no table of numbers{known}{advice}"
            )
    return f"has no table of numbers{known}; expected rows of numbers below a row of names{advice}"


def _cut_by_commas(table: Table, head: list[str]) -> str:
    """What to say where rows have twice the fields of the names, which decimal commas between commas make."""
    above = [split_row(line, ",") for line in head[: table.first]]
    named = [k for k, row in enumerate(above) if len(row) > 1 and not any(is_number(one, ".") for one in row)]
    if table.separator != "," or not named or any(name and not is_number(name, ".") for name in table.names):
        return ""
    count = len(above[named[-1]])
    if not 2 * count - (count > 2) <= table.width <= 2 * count:  # whole numbers are printed without a decimal sign
        return ""
    return (
        f"row {named[-1] + 1} names {count} columns, and the rows below have {table.width} fields: decimal commas "
        "between commas cannot be told apart; export with another separator or with decimal points"
    )
