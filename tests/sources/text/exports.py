"""Writes text exports as instruments lay them out, from their makers' published descriptions; knows nothing of acqd.

Each writer takes a time axis, a voltage in V, a current in A and a locale (separator and decimal sign), and returns the
text of one file. The files are made here, not by the instruments.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

RATE = 10_000.0


@dataclass(frozen=True)
class Locale:
    separator: str
    decimal: str

    def number(self, value: float, digits: int = 7) -> str:
        return f"{value:.{digits}g}".replace(".", self.decimal)

    def row(self, *fields: object) -> str:
        return self.separator.join(self.number(field) if isinstance(field, float) else str(field) for field in fields)


ENGLISH, GERMAN, TABBED = Locale(",", "."), Locale(";", ","), Locale("\t", ",")
Writer = Callable[[Locale, np.ndarray, np.ndarray, np.ndarray], str]


def _table(at: Locale, *columns: np.ndarray, tail: str = "") -> list[str]:
    return [at.row(*map(float, row)) + tail for row in zip(*columns, strict=True)]


def picoscope(at, t, u, i):
    """PicoScope 6 user's guide: names, units in brackets, a blank row, time in ms, current probe in mA."""
    names = {",": ("Time", "Channel A", "Channel B")}.get(at.separator, ("Zeit", "Kanal A", "Kanal B"))
    return "\n".join([at.row(*names), at.row("(ms)", "(V)", "(mA)"), "", *_table(at, t * 1e3 - 5, u, i * 1e3)])


def tektronix(at, t, u, i):
    """MSO5: model, interval, units, source, then TIME."""
    head = [at.row("Model", "MSO54"), at.row("Firmware Version", "1.44"), "", at.row("Waveform Type", "ANALOG", "", ""),
            at.row("Point Format", "Y"), at.row("Horizontal Units", "s"), at.row("Horizontal Scale", 0.004),
            at.row("Sample Interval", 1 / RATE), at.row("Record Length", len(t)), at.row("Gating", "0.0% to 100.0%"),
            at.row("Probe Attenuation", 1, "", 1), at.row("Vertical Units", "V", "", "A"),
            at.row("Vertical Offset", 0, "", 0), "", "", at.row("TIME", "CH1", "CH2")]  # fmt: skip
    return "\n".join([*head, *_table(at, t - 0.05, u, i)])


def tektronix_wide(at, t, u, i):
    """DPO4000: preamble rows, then names and a table in s."""
    head = [at.row("Model", "DPO4034"), at.row("Sample Interval", 1 / RATE), at.row("Source", "CH1", "CH2"),
            at.row("Vertical Units", "V", "A"), at.row("TIME", "CH1", "CH2")]  # fmt: skip
    return "\n".join([*head, *_table(at, t, u, i)])


def lecroy(at, t, u, i):
    """LeCroy ASCII of two channels pasted side by side keeps Time,Ampl; here the multi-channel spreadsheet form."""
    head = [at.row("LECROYHDO6104", 17_000, "Waveform"), at.row("Segments", 1, "SegmentSize", len(t)),
            at.row("Segment", "TrigTime", "TimeSinceSegment1"), at.row("#1", "21-Jun-2023 10:15:00", 0),
            at.row("Time (s)", "Voltage (V)", "Current (A)")]  # fmt: skip
    return "\n".join([*head, *_table(at, t - 0.01, u, i)])


def rigol(at, t, u, i):
    """MSO1000Z: X, channels, Start, Increment; Sequence counts the rows; a separator at the end."""
    tail = at.separator
    head = [at.row("X", "CH1", "CH2", "Start", "Increment"),
            at.row("Sequence", "Volt", "Ampere", f"{-0.05}", f"{1 / RATE}")]  # fmt: skip
    return "\n".join([*head, *_table(at, np.arange(len(t)), u, i, tail=tail)])


def keysight(at, t, u, i):
    """InfiniiVision: x-axis and numbers of channels; second,Volt,Ampere."""
    return "\n".join([at.row("x-axis", "1", "2"), at.row("second", "Volt", "Ampere"), *_table(at, t - 0.02, u, i)])


def siglent(at, t, u, i):
    """SDS2000: record length, interval, units, source; a row of units stands for the names."""
    head = [at.row("Record Length", f"Analog:{len(t)}"), at.row("Sample Interval", f"{1 / RATE:.6E}"),
            at.row("Vertical Units", "V", "A"), at.row("Vertical Scale", "100.0", "5.0"),
            at.row("Source", "CH1", "CH2"), at.row("Second", "Volt", "Ampere")]  # fmt: skip
    return "\n".join([*head, *_table(at, t - 0.05, u, i)])


def labview(at, t, u, i):
    """Specification of .lvm: header blocks, one X column, an empty comment column."""
    decimal = at.decimal
    head = ["LabVIEW Measurement\t", "Writer_Version\t2", "Reader_Version\t2", "Separator\tTab",
            f"Decimal_Separator\t{decimal}", "Multi_Headings\tNo", "X_Columns\tOne", "Time_Pref\tAbsolute",
            "Operator\tme", "Date\t2023/06/21", f"Time\t10:15:00{decimal}250000", "***End_of_Header***\t", "\t",
            "Channels\t2\t\t\t", f"Samples\t{len(t)}\t{len(t)}\t\t", "Date\t2023/06/21\t2023/06/21\t\t",
            "Y_Unit_Label\tVolts\tAmps\t\t", "X_Dimension\tTime\tTime\t\t",
            f"X0\t0{decimal}0\t0{decimal}0\t\t", f"Delta_X\t{at.number(1 / RATE)}\t{at.number(1 / RATE)}\t\t",
            "***End_of_Header***\t\t\t\t", "X_Value\tVoltage\tCurrent\tComment"]  # fmt: skip
    tabs = Locale("\t", decimal)
    return "\n".join([*head, *_table(tabs, t, u, i, tail="\t")])


def dewesoft(at, t, u, i):
    """DewesoftX text export: about the file, then names with units."""
    head = ["File name: press.dxd", "Start time: 21.06.2023 10:15:00.250", "Number of channels: 2",
            f"Sample rate: {RATE:g} Hz", "Store type: always fast", "", at.row("Time (s)", "U1 (V)", "I1 (A)")]  # fmt: skip  # noqa: E501
    return "\n".join([*head, *_table(at, t, u, i)])


def yokogawa(at, t, u, i):
    """DL850 ASCII: no time column; every row begins with a separator."""
    head = [at.row('"Model Name"', '"DL850"'), at.row('"BlockNumber"', '"1"'), at.row('"TraceName"', '"CH1"', '"CH2"'),
            at.row('"BlockSize"', f'"{len(t)}"', f'"{len(t)}"'), at.row('"VUnit"', '"V"', '"A"'),
            at.row('"SampleRate"', f'"{RATE:g}"', f'"{RATE:g}"'), at.row('"HResolution"', '"1e-04"', '"1e-04"'),
            at.row('"HOffset"', '"-0.05"', '"-0.05"'), at.row('"HUnit"', '"s"', '"s"'),
            at.row('"Date"', '"2023/06/21"', '"2023/06/21"'), at.row('"Time"', '"10:15:00.25"', '"10:15:00.25"'), ""]  # fmt: skip  # noqa: E501
    return "\n".join([*head, *(at.separator + row for row in _table(at, u, i))])


def hioki(at, t, u, i):
    """MR8847 text: quoted preamble, trigger time with an apostrophe, names with units."""
    head = [at.row('"File name"', '"AUTO0001"'), at.row('"Title comment"', '""'),
            at.row('"Trigger Time"', "\"'23-06-21 10:15:00.250\""), at.row('"CH"', '"CH1-1"', '"CH2-1"'),
            at.row('"Mode"', '"Voltage"', '"Current"'), at.row('"Range"', '"500V"', '"20A"'),
            at.row('"Time[s]"', '"CH1-1[V]"', '"CH2-1[A]"')]  # fmt: skip
    return "\n".join([*head, *_table(at, t, u, i)])


def commented(at, t, u, i):
    """numpy.savetxt with a header: names in a comment."""
    return "\n".join(["# site: press 3", "# " + at.row("time [ms]", "u1 [V]", "i1 [A]"), *_table(at, t * 1e3, u, i)])


def stamped(at, t, u, i):
    """A logger: ISO stamps, a text column, and an event column that stays empty."""
    rows = [
        f"2023-06-21T10:15:{seconds:09.6f}Z".replace(".", ".")
        + at.separator + at.row(float(v), float(a)) + at.separator + "ok" + at.separator
        for seconds, v, a in zip(t, u, i, strict=True)
    ]  # fmt: skip
    return "\n".join([at.row("timestamp", "U [V]", "I [A]", "state", "event"), *rows])


def time_of_day(at, t, u, i):
    """Two columns of date and time."""
    rows = [f"21.06.2023{at.separator}10:15:{s:09.6f}".replace(".", ".") + at.separator + at.row(float(v), float(a))
            for s, v, a in zip(t, u, i, strict=True)]  # fmt: skip
    return "\n".join([at.row("Date", "Time", "u1/V", "i1/A"), *rows])


def kilo(at, t, u, i):
    """Units row with prefixes, and a sampling rate in the preamble instead of times."""
    head = [at.row("Sampling rate", "10 kHz"), at.row("U L1", "I L1"), at.row("kV", "mA")]
    return "\n".join([*head, *_table(at, u / 1e3, i * 1e3)])


WRITERS: dict[str, tuple[Writer, str]] = {
    "picoscope": (picoscope, "picoscope"), "tektronix": (tektronix, "tektronix"),
    "tektronix_wide": (tektronix_wide, "tektronix"), "lecroy": (lecroy, "lecroy"), "rigol": (rigol, "rigol"),
    "keysight": (keysight, "keysight"), "siglent": (siglent, "siglent"), "labview": (labview, "labview"),
    "dewesoft": (dewesoft, "dewesoft"), "yokogawa": (yokogawa, "yokogawa"), "hioki": (hioki, "hioki"),
    "commented": (commented, "plain"), "stamped": (stamped, "plain"), "time_of_day": (time_of_day, "plain"),
    "kilo": (kilo, "plain"),
}  # fmt: skip
"""Name: the writer, and the layout that recognises it."""
