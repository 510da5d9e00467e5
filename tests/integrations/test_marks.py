"""What devices work on, from topics of a production system into the file that `acqd energy --by part` reads."""

from __future__ import annotations

import json
import os

import pytest

from acqd.energy.marks import read_marks
from acqd.errors import InputError
from acqd.integrations.marks.file import MarksFile
from acqd.integrations.marks.section import MarksSection
from acqd.integrations.marks.writer import MarksWriter
from acqd.timestamps import rfc3339
from tests.commands import acqd_here, refused

S = 1_000_000_000
T0 = 1_795_000_000 * S
TOPICS = [{"topic": "mes/{device}/part", "kind": "part"}, {"topic": "line 2", "kind": "step", "device": "cell-2"}]


class Clock:
    def __init__(self):
        self.ns = T0

    def __call__(self):
        return self.ns


def listening(path, clock, **section):
    return MarksWriter(MarksSection(topics=TOPICS, **section), MarksFile(path, clock.ns), clock)


def marks(path, kind="part"):
    """(s after T0, value) by device."""
    found = read_marks(path, kind)
    return {
        device: list(zip([(int(t) * 100 - T0) / S for t in of.ticks], of.names, strict=True))
        for device, of in found.items()
    }


def test_values_of_topics_are_marks_and_repeated_ones_are_not(tmp_path):
    path, clock = tmp_path / "m.csv", Clock()
    writer = listening(path, clock)
    assert writer.subscriptions() == ["mes/+/part", "line 2"]
    for topic, payload in (
        ("mes/cell-1/part", b"gear, large"), ("mes/cell-1/part", b"gear, large"), ("line 2", b"17"),
        ("mes/cell-1/part", b'{"value": "shaft"}'), ("mes/cell-1/part", b'"shaft"'), ("mes/cell-1/part", b"null"),
        ("mes/a/b/part", b"other"), ("line 2", "schweißen\n2".encode()),
    ):  # fmt: skip
        clock.ns += S
        assert list(writer.take(topic, payload)) == [] and list(writer.tick()) == []
    assert marks(path) == {"cell-1": [(1, "gear, large"), (4, "shaft"), (6, "")], "cell-2": []}
    assert marks(path, "step")["cell-2"] == [(3, "17"), (8, "schweißen 2")] and writer.refused == 0


@pytest.mark.parametrize(
    "at", [rfc3339(T0 + 5 * S), rfc3339(T0 + 5 * S).replace("Z", "+00:00"), T0 / S + 5, T0 // 10**6 + 5_000]
)
def test_a_message_may_have_its_own_time(tmp_path, at):
    clock = Clock()
    clock.ns += 86_400 * S
    writer = listening(tmp_path / "m.csv", clock, value="v", time="at")
    list(writer.take("mes/c/part", json.dumps({"v": "gear", "at": at}).encode()))
    assert marks(tmp_path / "m.csv")["c"] == [(5, "gear")]


@pytest.mark.parametrize(
    "payload",
    [b'{"part": "gear"}', b'{"value": {}}', b"\xff\xfe", b"[1]", b'{"value": "a", "time": "2026-11-18T11:00"}',
     b'{"value": "a", "time": 9e99}', b'{"value": "a", "time": true}', b'{"value": "a", "time": 1999999999}',
     b'{"value": "a", "time": 1794999000}'],
)  # fmt: skip
def test_what_is_no_value_or_no_time_is_said_once(tmp_path, payload, caplog):
    clock = Clock()
    writer = listening(tmp_path / "m.csv", clock)
    list(writer.take("mes/c/part", b"gear"))
    for _ in range(3):
        list(writer.take("mes/c/part", payload))
    said = [record for record in caplog.records if "mes/c/part" in record.getMessage()]
    assert len(said) == 1 and writer.refused in (1, 3) and marks(tmp_path / "m.csv")["c"][0] == (0, "gear")
    assert all(at <= 1 for at, _ in marks(tmp_path / "m.csv")["c"])  # none in the future, none in the past


@pytest.mark.parametrize("ending", ["stopped", "killed", "connection lost"])
def test_nothing_is_claimed_for_the_time_in_which_nobody_listened(tmp_path, ending):
    path, clock = tmp_path / "m.csv", Clock()
    writer = listening(path, clock)
    list(writer.take("mes/c/part", b"gear"))
    for _ in range(10):
        clock.ns += S
        list(writer.tick())
    if ending == "stopped":
        writer.close()
    clock.ns += 100 * S
    if ending != "connection lost":
        writer = listening(path, clock)
    list(writer.begin())
    list(writer.take("mes/c/part", b"gear"))  # retained
    (first, (gone, name), again) = marks(path)["c"]
    assert first == (0, "gear") and name == "" and again == (110, "gear")
    assert gone == pytest.approx(10, abs=0.01)
    clock.ns += 2 * S
    listening(path, clock)
    list(listening(path, clock).begin())  # a restart within seconds
    assert len(marks(path)["c"]) == 3


def said(value, at_s):
    return json.dumps({"value": value, "time": rfc3339(T0 + at_s * S)}).encode()


@pytest.mark.parametrize("ending", ["restarted", "connection lost"])
def test_a_retained_message_with_its_time_counts_again_after_a_break(tmp_path, ending):
    path, clock = tmp_path / "m.csv", Clock()
    writer = listening(path, clock)
    list(writer.take("mes/c/part", said("gear", -100)))
    for _ in range(10):
        clock.ns += S
        list(writer.tick())
    if ending == "restarted":
        writer.close()
        writer = listening(path, clock)
    clock.ns += 20 * S
    list(writer.begin())
    list(writer.take("mes/c/part", said("gear", -100)))  # retained: since then, and still
    begun, gone, again = marks(path)["c"]
    assert begun == (-100, "gear") and gone[1] == "" and again[1] == "gear"
    assert again[0] == pytest.approx(gone[0], abs=0.01) and writer.refused == 0
    list(writer.take("mes/c/part", said("older", -200)))
    assert writer.refused == 1 and len(marks(path)["c"]) == 3


def test_topics_of_a_device_may_be_of_different_ages_and_clocks(tmp_path):
    path, clock = tmp_path / "m.csv", Clock()
    topics = [{"topic": f"mes/{{device}}/{kind}", "kind": kind} for kind in ("part", "state", "step")]
    writer = MarksWriter(MarksSection(topics=topics), MarksFile(path, clock.ns), clock)
    list(writer.take("mes/c/state", said("run", -60)))
    list(writer.take("mes/c/part", said("gear", -600)))  # retained, and older than the state
    list(writer.take("mes/c/part", said("shaft", 30)))  # a clock that is ahead
    clock.ns += 5 * S
    list(writer.take("mes/c/step", b"7"))  # of a PLC without a clock
    assert writer.refused == 0 and marks(path, "state")["c"] == [(-60, "run")]
    assert marks(path)["c"] == [(pytest.approx(-60, abs=1e-5), "gear"), (30, "shaft")]
    assert marks(path, "step")["c"] == [(pytest.approx(30, abs=1e-5), "7")]


@pytest.mark.parametrize("form", ["%s", " %s\n", '{"value": %s}', '{"value": %s, "time": 1795000000.5}'])
def test_a_number_keeps_the_digits_of_its_message(tmp_path, form):
    path, clock, writer = tmp_path / "m.csv", Clock(), None
    writer = listening(path, clock)
    numbers = ["12345678901234567890123", "12345678901234567890124", "12.50", "12.5", "1E5", "100000"]
    for number in numbers:
        list(writer.take("mes/c/part", (form % number).encode()))
    assert [name for _, name in marks(path)["c"]] == numbers
    assert marks(path)["c"][0][0] == (0.5 if "time" in form else 0)


def test_text_that_no_file_can_hold_is_no_end_of_the_bridge(tmp_path):
    writer = listening(tmp_path / "m.csv", Clock())
    for payload in (b'"half \\ud800"', b"[" * 100_000, b'{"value": ' + b"9" * 5_000 + b"}"):
        list(writer.take("mes/c/part", payload))
    names = [name for _, name in marks(tmp_path / "m.csv")["c"]]
    assert names == ["half ?", "[" * 200, "9" * 200]


@pytest.mark.parametrize("device", ["a\nb", "c\u2028d", "..", "x" * 65])
def test_a_level_that_names_no_device_is_left_out(tmp_path, device, caplog):
    path, clock = tmp_path / "m.csv", Clock()
    writer = listening(path, clock)
    for name in (device, "c"):
        list(writer.take(f"mes/{name}/part", b"gear"))
    assert writer.refused == 1 and "cannot be the name of a device" in caplog.text
    assert list(marks(path)) == ["c"] and MarksFile(path, clock.ns).lines == 0


def test_a_full_disk_leaves_no_part_of_a_line(tmp_path, monkeypatch):
    path, clock, write = tmp_path / "m.csv", Clock(), os.write
    writer = listening(path, clock)
    list(writer.take("mes/c/part", b"gear"))
    monkeypatch.setattr(os, "write", lambda where, content: write(where, content[:20]))
    with pytest.raises(OSError, match=r"No space left.*m\.csv"):
        list(writer.take("mes/c/part", b"shaft"))
    monkeypatch.setattr(os, "write", write)
    assert path.read_bytes().endswith(b",gear,\n")
    clock.ns += S
    list(writer.take("mes/c/part", b"shaft"))
    assert marks(path)["c"] == [(0, "gear"), (1, "shaft")]


def test_a_line_that_a_power_cut_has_left_is_cut_off_and_another_file_is_refused(tmp_path):
    path, clock = tmp_path / "m.csv", Clock()
    list(listening(path, clock).take("mes/c/part", b"gear"))
    with path.open("a") as file:
        file.write("2026-11-18T1")
    os.utime(path, ns=(clock.ns, clock.ns))
    list(listening(path, clock).take("mes/c/part", b"shaft"))
    assert marks(path)["c"] == [(0, "gear"), (1e-6, "shaft")]
    for text, why in (("time,part\n", "is no file of acqd bridge marks"), (path.read_text() + "a,b\n", "2 values")):
        (tmp_path / "o.csv").write_text(text)
        with pytest.raises(InputError, match=why):
            MarksFile(tmp_path / "o.csv", clock.ns)


@pytest.mark.parametrize(
    ("topics", "why"),
    [("[{ topic = 'a/+/b', kind = 'part', device = 'x' }]", "marks.topics.0.topic: expected a topic without +, #"),
     ("[{ topic = 'a/b', kind = 'part', device = 'cell 2' }]", "device 'cell 2': expected 1 to 64 letters"),
     ("[{ topic = 'a/b', kind = 'part' }]", "expected one level {device}, or a key device"),
     ("[{ topic = 'a/{device}', kind = 'part', device = 'x' }]", "expected one level {device}"),
     ("[{ topic = 'a/{device}', kind = 'lot' }]", "marks.topics.0.kind"), ("[]", "[marks] of acqd.toml needs file")],
)  # fmt: skip
def test_topics_that_cannot_be_are_one_line(tmp_path, topics, why):
    (tmp_path / "acqd.toml").write_text(f"[marks]\nfile = 'm.csv'\ntopics = {topics}\n")
    assert why in refused(acqd_here("bridge", "marks", "--config", tmp_path / "acqd.toml"))
