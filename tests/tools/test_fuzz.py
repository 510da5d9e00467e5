"""Every parser refuses bad input in one line, and the harness that says so can fail."""

from __future__ import annotations

import io
import random
import time
import zipfile

import orjson
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.errors import UserError
from tools.studies.fuzz import campaign
from tools.studies.fuzz.campaign import Limits, input_of, run_parser
from tools.studies.fuzz.judge import outcome
from tools.studies.fuzz.memory import ALLOWANCE, FACTOR, Peak
from tools.studies.fuzz.mutate import mutated
from tools.studies.fuzz.seeds.descriptions import profiles
from tools.studies.fuzz.targets import TARGETS, Target

LIBRARIES = ("mat", "hdf5", "parquet", "arrow", "tdms", "wfm")
"""Parsers of other people; `make fuzz` gives them more inputs."""
LIMIT_S = 60.0  # a busy machine is no failure


GROUPED = [
    pytest.param(one, marks=pytest.mark.xdist_group("files")) if one.name in LIBRARIES else one for one in TARGETS
]


@pytest.mark.parametrize("target", GROUPED, ids=lambda target: target.name)
def test_valid_input_is_taken_and_anything_else_refused_in_one_line(target):
    seeds = target.seeds()
    for files in seeds:
        assert outcome(target, files, LIMIT_S).kind == "accepted"

    @settings(max_examples=6 if target.name in LIBRARIES else 25)
    @given(st.randoms(use_true_random=False))
    def refused_in_one_line(chance):
        files = mutated(chance.choice(seeds), seeds, chance)
        end = outcome(target, files, LIMIT_S)
        assert end.kind != "failure", (end.reason, files)

    refused_in_one_line()


def no_array():
    """An archive with a member that is no array."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for name in ("u_code", "i_code", "u_V_per_digit", "i_A_per_digit", "fs"):
            archive.writestr(f"{name}.npy", b"text")
    return packed.getvalue()


FOUND = {
    "log, no column": {"robot.log": b"%\n1 2\n"},
    "power-csv, year": {"p.csv": b"time,P\n2026-11-22T10:00:00Z,1\n2999-11-22T10:00:00Z,2\n"},
    "log, digits": {"robot.log": b"time,q" + b"9" * 5000 + b"\n1,2\n"},
    "row, channel": {"row.json": b'{"device":"a","channel":"' + b"9" * 5000 + b'"}'},
    "power-csv, far": {"p.csv": b"filetime,P\n" + b"9" * 30 + b",1\n1,2\n3,4\n"},
    "power-csv, later": {"p.csv": b"time,P\n9e10,1\n9.1e10,2\n9.2e10,4\n"},
    "npz, no array": {"a.npz": no_array()},
    "npz": {"a.npz": b"PK\x05\x06" + b"\x00" * 18},
    "csv": {"a.csv": b"\xef\xbb\xbf"},
    "csv-rate": {"a.csv": b"time,u1,i1\n1e308,1,1\n1e308,2,2\n"},
    "config": {"acqd.toml": b"device = " + b"9" * 5000},
    "robot": {"robot.toml": b"a = " + b"[" * 5000},
    "urdf": {"robot.urdf": b"<robot name='\xe2\x80\xa8'><link name='" + b"[" * 9000 + b"'/><joint/></robot>"},
    "meter-profile": {"meter.toml": b"\xff"},
    "isf, digits": {
        "a_CH1.isf": b":WFMPRE:BYT_NR 1;ENCDG ASC;XINCR 1E-4;YMULT 1;YOFF 0;YZERO 0;NR_PT "
        + b"9" * 5000
        + b";:CURVE 1,2,3"
    },
    "isf, skew": {
        f"a_CH{k}.isf": b':WFMPRE:BYT_NR 1;ENCDG ASC;XINCR 1E-4;YMULT 1;YOFF 0;YZERO 0;WFID "Ch%d";YUNIT "%b";XZERO %b;'
        b":CURVE 1,2,3" % (k, unit, zero)
        for k, unit, zero in ((1, b"V", b"1e308"), (2, b"A", b"0"))
    },
    "meter-profile, type": {
        "meter.toml": profiles()[0]["meter.toml"].replace(b"most_registers = 50", b'most_registers = ""')
    },
    "power-csv, no UTF-8": {"p.csv": b"time,P,device\n1,2,a\n2,\xff\n3,4,a\n"},
    "power-csv": {"p.csv": b"time,P,device\n1,2,\xff\n"},
    "power-jsonl": {"p.jsonl": b'{"time": 1, "P": 2, "device": null}\n{"time": 2, "P": 2, "device": "a"}\n'},
    "row": {"row.json": b"[" * 100_000},
    "table": {"robot.csv": b"\x00" * 3_000_000},
    "log": {"robot.log": b"time,q1,q2,q3,q4,q5,q6\n" + b"1e308,1,1,1,1,1,1\n" * 90},
    "bundle": {"bundle.json": b'{"format": 1, "kind": []}', "weights.safetensors": b"\x00" * 9},
}


@pytest.mark.parametrize("name", FOUND)
def test_inputs_that_were_found_stay_refused(name):
    target = next(target for target in TARGETS if target.name == name.split(",")[0])
    assert outcome(target, FOUND[name], LIMIT_S).kind == "refused"


def raising(error):
    def read(_):
        raise error

    return Target("made up", list, read)


def test_the_judge_tells_failures():
    assert outcome(raising(UserError("one line")), {}, 1.0).kind == "refused"
    assert outcome(Target("made up", list, lambda _: None), {}, 1.0).kind == "accepted"
    assert "KeyError" in outcome(raising(KeyError("x")), {}, 1.0).reason
    assert "2 lines" in outcome(Target("m", list, raising(ValueError("a\nb")).read, (ValueError,)), {}, 1.0).reason
    assert "longer than" in outcome(Target("made up", list, lambda _: time.sleep(9)), {}, 0.05).reason


def test_the_judge_hears_of_exceptions_that_python_only_prints():
    class Dying:
        def __del__(self):
            raise KeyError("x")

    assert "KeyError" in outcome(Target("made up", list, lambda _: Dying()), {}, 1.0).reason


def test_an_input_that_takes_memory_is_a_failure_and_the_next_one_is_not():
    peak = Peak()
    bytearray(FACTOR * 8 + ALLOWANCE + (32 << 20))
    assert "memory" in peak.excess({"a": b"12345678"})
    assert not peak.excess({"a": b""})


def test_inputs_are_reproducible_and_differ():
    seeds = TARGETS[0].seeds()
    first = [input_of("csv", 1, number, seeds) for number in range(50)]
    assert first == [input_of("csv", 1, number, seeds) for number in range(50)]
    assert len({files["a.csv"] for files in first}) > 40
    assert first != [input_of("csv", 2, number, seeds) for number in range(50)]
    assert mutated({"a": b""}, [{"a": b""}], random.Random(1))  # nothing to change is no mistake


def test_a_campaign_counts_every_input_once(tmp_path):
    tally = run_parser("row", 1, 400, Limits(), tmp_path, lambda _: None)
    assert tally.inputs == 400 == tally.accepted + tally.refused and not tally.failures
    assert campaign._ending(-11) == "SIGSEGV"
    tally.failures["KeyError"] += 2
    assert orjson.loads(orjson.dumps(tally.as_json()))["failures"] == {"KeyError": 2}
