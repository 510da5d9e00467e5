"""Where the table of a text export is: preamble, names, units, first row of numbers, separator and decimal sign.

The table is the first run of rows that have the same number of fields and, but for text columns, numbers in them, for
one separator and one decimal sign. What stands above are names, units and a preamble.
"""

from __future__ import annotations

import contextlib
import csv
import re
from dataclasses import dataclass, field

from acqd.sources.recording.units import UnknownUnitError, codes_word, split_label, unit_of
from acqd.sources.text.layout import Layout, key_of

HEAD_LINES = 400
"""Lines in which the table begins."""
_BESIDE = 60  # lines in which the preamble stands beside the table
_RUN = 3  # consecutive rows that make a table, if the file has as many
_COMMENT = re.compile(r'^\s*"?(?:#|%|//|;(?![\d\s.,;-]*$))+\s*')
_COMMENT_BESIDE_SEMICOLONS = re.compile(r'^\s*"?(?:#|%|//)+\s*')
_DATA = re.compile(r"(?i)(?:wave\s?form\s)?(?:data|daten|values)\b.*|begin.*")
"""A line of one field between the names and the numbers."""
_LABELS = ("trace", "tracename", "channel", "channels", "ch", "signal", "name", "unit", "units", "vunit")
"""First field of a row of names or units where the rows of numbers have none."""
_NO_UNITS = ("utc", "local", "sequence", "no", "nr", "rn", "record", "ts", "time", "timestamp", "date", "datetime")
"""What stands for the unit of a column of numbers of rows, or of stamps."""
_TAKEN_AS = ("smp", "sample", "inst")
"""What data loggers write below the unit of a sample (Campbell TOA5)."""
_DIALECTS = (
    ("\t", "."),
    (";", "."),
    (",", "."),
    ("\t", ","),
    (";", ","),
    ("|", "."),
    (" ", "."),
    (" ", ","),
    (",", ","),
)
"""Separators and decimal signs; decimal commas between commas are read where the numbers stand in quotes."""
_KEY_UNIT = re.compile(r"(.+?)\s*[\[(]\s*([^\[\]()]+?)\s*[\])]\s*$")
"""A key of the preamble with the unit of its value: `Sample Rate [kS/s]`."""
_NUMBER = re.compile(r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?$|[+-]?(?:nan|inf|infinity|∞)$", re.IGNORECASE)
_STAMP = re.compile(
    r"\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}[ T_]*(?:\d{1,2}:\d{2}(?::\d{2})?.*)?$|'?\d{1,2}:\d{2}:\d{2}(?:[.,:]\d+)?$"
)


@dataclass(slots=True)
class Table:
    """A table found in the first lines of a file."""

    separator: str
    decimal: str
    first: int
    """Line of the first row of numbers, from 0."""
    names: list[str] = field(default_factory=list)
    units: list[str] = field(default_factory=list)
    preamble: dict[str, list[str]] = field(default_factory=dict)
    """Values of the lines above, by `key_of` their first field."""
    stray: dict[str, str] = field(default_factory=dict)
    """Names of the header row beside the channels, and what stands below them: Start and Increment of Rigol."""
    width: int = 0
    started: int = 0
    """Rows above the first one in which some channels have no number yet."""


def split_row(line: str, separator: str) -> list[str]:
    """Fields of a line, without quotes and spaces."""
    if separator == " ":
        return line.replace('"', "").split()
    fields = line.split(separator)
    if '"' in line:
        with contextlib.suppress(csv.Error):  # a field longer than csv reads
            fields = next(csv.reader([line.rstrip("\r\n")], delimiter=separator), [])
    return [one.strip().strip('"').strip() for one in fields]


def find_table(lines: list[str], layout: Layout) -> Table | None:
    """The table in the first lines; None where there are no rows of numbers."""
    best: Table | None = None
    for separator, decimal in _DIALECTS:
        begin = layout.first_row - 1 if layout.first_row else _first_run(lines, separator, decimal, layout)
        if begin is None or begin >= len(lines):
            continue
        width = len(_picked(_filled(split_row(lines[begin], separator)), layout))
        if width < 2 or (best is not None and (best.first, -best.width) <= (begin, -width)):
            continue
        if separator == " " and best is not None and best.first == begin and best.separator in "\t;|":
            continue  # spaces within fields, as between date and time
        best = Table(separator, decimal, begin, width=width)
    if best is None:
        return None
    _read_header(best, lines, layout)
    return best


def _first_run(lines: list[str], separator: str, decimal: str, layout: Layout) -> int | None:
    """The first line from which rows of numbers of equal width follow each other."""
    rows = 0
    width = 0
    begin = None
    for at, line in enumerate(lines):
        if not line.strip():
            continue
        count = _numeric_width(_picked(split_row(line, separator), layout), decimal)
        if count and (count == width or rows == 0):
            begin = at if rows == 0 else begin
            rows, width = rows + 1, count
            if rows >= _RUN:
                return begin
        elif count > width:
            begin, rows, width = at, 1, count
        elif count:
            return begin  # a row that is cut off
        else:
            begin, rows, width = None, 0, 0
    return begin if rows else None


def _numeric_width(fields: list[str], decimal: str) -> int:
    """Number of fields of a row of the table, trailing empty ones left out; 0: it is none."""
    fields = _filled(fields)
    numbers = sum(is_number(text, decimal) for text in fields)
    if not numbers or numbers + sum(_STAMP.match(text) is not None for text in fields) < 2:
        return 0
    texts = [text for text in fields if text and not is_number(text, decimal) and not _STAMP.match(text)]
    if len(texts) > numbers or any(re.fullmatch(r"[\d.,;|+\-eE\s]+", text) for text in texts):
        return 0
    if fields and fields[0] and not is_number(fields[0], decimal) and not _STAMP.match(fields[0]):
        return 0  # a line of the preamble: its first field is a key
    return len(fields)


def _filled(fields: list[str]) -> list[str]:
    while fields and not fields[-1]:
        fields = fields[:-1]
    return fields


def _picked(fields: list[str], layout: Layout) -> list[str]:
    return [fields[k] for k in layout.columns if k < len(fields)] if layout.columns else fields


def is_number(text: str, decimal: str) -> bool:
    """Whether a field is a number with this decimal sign."""
    if decimal == ",":
        if "." in text:
            return False
        text = text.replace(",", ".")
    return _NUMBER.match(text) is not None


def _read_header(table: Table, lines: list[str], layout: Layout) -> None:
    """Names, units and preamble from the lines above the table."""
    comment = _COMMENT_BESIDE_SEMICOLONS if table.separator == ";" else _COMMENT
    above = [comment.sub("", line) for line in lines[: table.first if not layout.columns else _BESIDE]]
    rows = [split_row(line, table.separator) for line in above]
    for line, row in zip(above, rows, strict=True):
        _note(table, line, row[: min(layout.columns)] if layout.columns else row)
    for text in (text for row in rows for text in row):
        if beside := re.fullmatch(r"(?i)tinc\s*=\s*(\S+)", text):  # Rigol: CH1V,CH2V,t0 = -0.1, tInc = 1e-05,
            table.stray["increment"] = beside[1].rstrip("s")
    above_names = [k for k in range(table.first - 1, -1, -1) if any(rows[k]) and not _is_preamble(rows[k], table.width)]
    candidates = [k for k in above_names if not _is_started(rows[k], table)]
    table.started = len(above_names) - len(candidates)
    if layout.names_row:
        candidates = [layout.names_row - 1]
    names_at = _header_rows(table, [_unlabelled(row, table.width) for row in rows], candidates, layout)
    names_at = _beside_numbers(table, lines, names_at)
    table.names = _padded(_named(table, layout.names) or names_at, table.width)
    if not table.units and are_units_alone(table.names):
        table.units, table.names = _padded([_bare(text) for text in table.names], table.width), [""] * table.width
    if named := _named(table, layout.units):
        table.units = _padded(named, table.width)
    table.units = table.units or [""] * table.width
    _name_times(table, layout)
    labels = list(table.names)
    for k, name in enumerate(labels):
        if not table.units[k]:
            table.names[k], table.units[k] = split_label(name, labels)
            table.units[k] = table.units[k] or codes_word(name)
    if any(table.units) and not any(table.names):
        table.names = [f"column {k}" for k in range(table.width)]


def _beside_numbers(table: Table, lines: list[str], names: list[str]) -> list[str]:
    """The names, behind an empty one for R's row names: a column that counts from 1, for which the header has none."""
    if len(_filled(names)) != table.width - 1 or not all(names[:1]):
        return names
    rows = [split_row(line, table.separator) for line in lines[table.first : table.first + _RUN]]
    if [row[0] for row in rows] != [str(number + 1) for number in range(_RUN)]:
        return names
    if table.units and not table.units[-1]:
        table.units = ["", *table.units[:-1]]
    return ["", *names]


def _name_times(table: Table, layout: Layout) -> None:
    """Columns without a name are times where the layout says so."""
    for k in [k for k, name in enumerate(table.names) if layout.times and not name]:
        table.names[k], table.units[k] = "time", layout.times


def _header_rows(table: Table, rows: list[list[str]], candidates: list[int], layout: Layout) -> list[str]:
    """The names above the table; a row of units below them is taken on the way."""
    for number, k in enumerate(candidates[:3]):
        row = _picked(rows[k], layout)
        if not _fits(row, table.width) and not (number == 0 and _are_units(row) and len(_filled(row)) < len(row)):
            return []
        below_name = number + 1 < len(candidates) and _fits(_picked(rows[candidates[number + 1]], layout), table.width)
        if not table.units and below_name and _are_units(row[: table.width]):
            table.units = _padded([_bare(text) for text in row], table.width)
            names = _picked(rows[candidates[number + 1]], layout)
            table.stray = {
                key_of(name): row[at]
                for at, name in enumerate(names)
                if at < len(row) and key_of(name) in ("start", "increment") and is_number(row[at], ".")
            }
            continue
        above = number + 1 < len(candidates) and _picked(rows[candidates[number + 1]], layout)
        if above and not table.units and len(_filled(above)) == table.width and _are_units(above[: table.width]):
            table.units = _padded([_bare(text) for text in above], table.width)  # units above the names
        return row
    return []


def _is_preamble(row: list[str], width: int) -> bool:
    """Whether a line above the numbers is neither names nor units."""
    said = [text for text in row if text]
    if row[0].endswith(":") and (len(said) < min(3, width) or not all(text.endswith(":") for text in said)):
        return True  # a key and its values
    return (len(said) == 1 and _DATA.fullmatch(said[0]) is not None) or all(key_of(one) in _TAKEN_AS for one in said)


def _is_started(row: list[str], table: Table) -> bool:
    """Whether a line is a row of the table in which channels are empty, as before the first sample of a slow one."""
    said = [text for text in row if text]
    return 0 < len(said) < len(row) >= table.width and all(is_number(text, table.decimal) for text in said)


def _unlabelled(row: list[str], width: int) -> list[str]:
    """`Unit,V,A` above rows of two numbers is V and A."""
    return row[1:] if len(_filled(row)) == width + 1 and key_of(row[0]) in _LABELS else row


def _fits(row: list[str], width: int) -> bool:
    """Whether a row may hold the names or units of a table of this width."""
    return len(row) >= width - 1 and len(row) > 1 and len([text for text in row if text]) >= min(width - 1, 2)


def _are_units(row: list[str]) -> bool:
    """Whether a row holds units (or nothing) only."""
    seen = 0
    for text in row:
        bare = _bare(text)
        if not bare or is_number(bare, "."):
            continue
        if key_of(bare) in _NO_UNITS:
            seen += key_of(bare) == "sequence"
            continue
        try:
            unit = unit_of(bare)
        except UnknownUnitError:
            if not re.fullmatch(r"[\[\(].+[\]\)]", text.strip()):
                return False
            seen += 1
            continue
        if unit is None and bare not in ("-", "--"):
            return False
        if len(bare) == 1 and bare in "tx":
            return False
        seen += 1
    return seen > 0 and any(_bare(text) not in ("A", "t", "x", "") for text in row)


def are_units_alone(row: list[str]) -> bool:
    """Whether texts that stand for names are units: `V,A` and not `A,B`."""
    try:
        found = [unit_of(_bare(text)) for text in row]
    except UnknownUnitError:
        return False
    quantities = [one.quantity for one in found if one is not None]
    return len(quantities) == len(row) and all(quantities) and "u" in quantities


def _bare(text: str) -> str:
    return text.strip().strip("[]()").strip()


def _padded(row: list[str], width: int) -> list[str]:
    return [*row[:width], *[""] * (width - len(row))]


def _note(table: Table, line: str, row: list[str]) -> None:
    """A line of the preamble: its first field is the key; `key: value` and `key = value` as well."""
    values = [text for text in row[1:] if text]
    if values and row[0] and ":" not in row[0]:
        if key_of(row[0]) in map(key_of, values):  # a key beside each of the channels: the others say less
            table.preamble[key_of(row[0])] = row[1:]
        table.preamble.setdefault(key_of(row[0]), row[1:])
        if bracketed := _KEY_UNIT.match(row[0]):
            given = [f"{text} {bracketed[2]}" if is_number(text, table.decimal) else text for text in row[1:]]
            table.preamble.setdefault(key_of(bracketed[1]), given)
        return
    match = re.match(r"\s*\"?([^:=]+?)\"?\s*[:=]\s*(.+?)\s*$", line)
    if match:
        said = match.group(2).strip().removeprefix(table.separator)
        table.preamble.setdefault(key_of(match.group(1)), split_row(said, table.separator))


_FACTOR = re.compile(r"multipl|factor|faktor|attenuation|gain|verst.rk|ratio|bersetzung|^(y)?scal(e|ing)(s)?$|skalier")


def factors(table: Table) -> list[str]:
    """Lines above the table that name factors other than 1; exports differ in whether their numbers have them."""
    found = []
    for key, values in table.preamble.items():
        numbers = [text for text in values if "∞" not in text and (is_number(text, ".") or is_number(text, ","))]
        if _FACTOR.search(key) and any(float(text.replace(",", ".")) not in (0.0, 1.0) for text in numbers):
            found.append(f"{key} {', '.join(numbers)}")
    return found


_PAIR = re.compile(r"(?i)(?:^|\s)CH?\d+:(\S+)")
"""`CH1:V CH2:A` and `CH1:V, CH2:A` of Siglent."""


def _named(table: Table, keys: tuple[str, ...]) -> list[str]:
    """Values of the first of these lines of the preamble."""
    for key in keys:
        if values := table.preamble.get(key_of(key)):
            if any(key_of(value) == key_of(key) for value in values):  # a table beside another: keys are in the columns
                return ["", *("" if key_of(value) == key_of(key) else _bare(value) for value in values)]
            if pairs := _PAIR.findall(" ".join(values)):
                return _aligned(pairs, table.width)
            return _aligned([_bare(value.removeprefix("Analog:")) for value in _filled(values)], table.width)
    return []


def _aligned(values: list[str], width: int) -> list[str]:
    """One value per channel stands for all columns but the time; empty fields between them do not count."""
    named = [value for value in values if value]
    return ["", *named] if len(named) == width - 1 else values
