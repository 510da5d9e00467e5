"""f, voltage and power of two cycles of acqd and pqopen-lib beside each other: simulated mains and real recordings.

    python -m tools.studies.frequency [--disturbances 200] [--first-disturbance 0] [--only-disturbances] [--json FILE]

The truth of a simulation is the mean f over the two cycles of each value; of a recording, zero crossings after a
band pass without a phase shift (`recorded`). pqopen-lib gives a value some 10 ms after its cycles have ended, acqd with
the last sample.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import orjson
from rich.console import Console
from rich.progress import track
from rich.table import Table

from acqd.arrays import Floats
from acqd.sources import load_waveform
from tools.bench.waves import RECORDINGS
from tools.studies.frequency.further import further_disturbance
from tools.studies.frequency.meters import Values, acqd, pqopen
from tools.studies.frequency.recorded import true_f
from tools.studies.frequency.waves import AMPERES, VOLTS, Wave, cases, random_disturbance

_NAMES = ("microwave_1ph_20k", "fridge_1ph_20k", "generator_3ph", "merging_unit_3ph")
_WRONG_HZ = 0.010
_DISTURBANCES = {"of f and near f": random_disturbance, "further": further_disturbance}
Line = dict[str, str | float]


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--disturbances", type=int, default=200)
    parser.add_argument(
        "--first-disturbance", type=int, default=0, help="seed of the first one; others: seen by nobody"
    )
    parser.add_argument("--only-disturbances", action="store_true", help="leave the table of two cycles out")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    lines = [] if arguments.only_disturbances else [*_simulated(), *_recordings()]
    if lines:
        _print("values of two cycles; errors of f in mHz, of V in %, of P in % of S", lines)
    seeds = range(arguments.first_disturbance, arguments.first_disturbance + arguments.disturbances)
    found = [_disturbances(name, make, seeds) for name, make in _DISTURBANCES.items()]
    _print("random disturbances (simulated): windows of acqd", found)
    if arguments.json:
        arguments.json.write_bytes(orjson.dumps([*lines, *found], option=orjson.OPT_INDENT_2))


def _simulated() -> Iterator[Line]:
    for wave in cases():
        codes, power = wave.codes(), None
        for name, meter in (("acqd", acqd), ("pqopen-lib", pqopen)):
            values = meter(codes, wave.form)
            level = np.abs(values.V / wave.V - 1) * 100
            power = np.median(values.P) if power is None else power
            yield _line(wave.name, name, values, wave.true_f, level, np.abs(values.P - power) / (VOLTS * AMPERES) * 100)


def _recordings() -> Iterator[Line]:
    for name in _NAMES if RECORDINGS.is_dir() else ():
        waveform = load_waveform(RECORDINGS / name / "replay_20k_el3783.npz")
        u = np.asarray(waveform.codes[:, 0::2].T, dtype=np.float64)
        truth = true_f(u, waveform.form.rate)
        table = np.genfromtxt(RECORDINGS / name / "ref_40ms.csv", delimiter=",", names=True)
        table = table[table["phase"] == 1]
        middle = (table["t_start_s"] + 0.02) * waveform.form.rate
        for meter_name, meter in (("acqd", acqd), ("pqopen-lib", pqopen)):
            values = meter(waveform.codes, waveform.form)
            centre = (values.begin + values.end) / 2
            V, P, S = (np.interp(centre, middle, table[column]) for column in ("U_sync", "P_sync", "S_sync"))
            yield _line(name, meter_name, values, truth, np.abs(values.V / V - 1) * 100, np.abs(values.P - P) / S * 100)


def _line(
    case: str, meter: str, values: Values, truth: Callable[[Floats, Floats], Floats], V: Floats, P: Floats
) -> Line:
    error = np.abs(values.error(truth)) * 1000
    silent = error[~values.doubted]
    return {
        "case": case,
        "meter": meter,
        "f median": round(float(np.nanmedian(error)), 2),
        "f p95": round(float(np.nanpercentile(error, 95)), 2),
        "f largest silent": round(float(np.nanmax(silent, initial=0.0)), 2),
        "V median": round(float(np.nanmedian(V)), 5),
        "V largest silent": round(float(np.nanmax(V[~values.doubted], initial=0.0)), 4),
        "P median": round(float(np.nanmedian(P)), 5),
        "flagged %": round(float(values.doubted.mean() * 100), 1),
    }


def _disturbances(kinds: str, make: Callable[[int], Wave], seeds: range) -> Line:
    wrong, flagged_right, right = 0, 0, 0
    cases_wrong: dict[str, int] = {}
    largest_Hz = 0.0
    for number in track(seeds, f"disturbances, {kinds}", console=Console(stderr=True)):
        wave = make(number)
        values = acqd(wave.codes(), wave.form)
        with np.errstate(invalid="ignore"):
            error = np.abs(values.error(wave.true_f))
            bad = ~(error <= _WRONG_HZ)
        silent = int((bad & ~values.doubted).sum())
        wrong += silent
        if silent:
            largest_Hz = max(largest_Hz, float(error[bad & ~values.doubted].max()))
            cases_wrong[wave.name] = cases_wrong.get(wave.name, 0) + silent
        right += int((~bad).sum())
        flagged_right += int((~bad & values.doubted).sum())
    return {
        "kinds": kinds,
        "disturbances": len(seeds),
        "first": seeds.start,
        "silent and off by 10 mHz": wrong,
        "of these": ", ".join(f"{name} {number}" for name, number in cases_wrong.items()) or "-",
        "largest of these, mHz": round(1000 * largest_Hz, 1),
        "right and flagged, %": round(100 * flagged_right / max(right, 1), 2),
    }


def _print(title: str, lines: list[Line]) -> None:
    table = Table(*lines[0], title=title, title_justify="left")
    for line in lines:
        table.add_row(*(str(value) for value in line.values()))
    Console(width=150).print(table)


if __name__ == "__main__":
    main()
