"""What is sent when: receipts, sinks that come and go, a backlog beside new rows. Time is virtual."""

from __future__ import annotations

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.telemetry.delivery import Delivery
from acqd.telemetry.message import Room
from acqd.telemetry.patience import LEAST_S, LONGEST_S
from acqd.telemetry.ranges import Ranges
from acqd.telemetry.receipt_watch import AHEAD
from acqd.telemetry.receipts import Commits, receipts
from acqd.telemetry.spool import Limits, Spool, SpooledRow, Stream
from acqd.telemetry.topics import OFFLINE, sink_status

STREAM = Stream("t", "L1", "boot")
ROOM = Room(64, 64)
SINK = sink_status("s")


class Bench:
    """A delivery with a clock that stands still until it is moved."""

    def __init__(self, until="stored", spool=None, **options):
        self.now = 100.0
        self.box = Delivery(Spool(None) if spool is None else spool, until, ["t"], lambda: self.now, **options)
        self.made = 0

    def make(self, count=1):
        for _ in range(count):
            self.box.put_rows([SpooledRow(STREAM, self.made, str(self.made).encode())])
            self.made += 1

    def take(self, room=ROOM):
        return [int(message.payload) for message in self.messages(room) if message.tag]

    def messages(self, room=ROOM):
        try:
            self.box.take(room).send(None)
        except StopIteration as done:
            return done.value
        raise AssertionError("take waits")

    def take_all(self, room=ROOM):
        taken = []
        while some := self.take(room):
            taken += some
        return taken

    def receipt(self, first, last, commits=None):
        for topic, payload in receipts("s", {STREAM: Ranges([(first, last)])}, commits):
            self.box.received(topic, payload, retained=False)

    def sink(self, state=b"{}", retained=False):
        self.box.received(SINK, state, retained=retained)


def test_a_row_waits_for_its_receipt_and_not_for_the_acknowledgement():
    bench = Bench()
    bench.box.begin()
    bench.make(10)
    assert bench.take() == list(range(10)) and len(bench.box) == 10
    bench.receipt(0, 6)
    assert len(bench.box) == 3 and bench.box.outstanding == 3
    bench.receipt(7, 50)
    assert len(bench.box) == 0 and bench.box.outstanding == 0


def test_the_rows_of_a_window_travel_in_one_message_and_are_settled_one_by_one():
    channels = [Stream("t", name, "boot") for name in ("L1", "L2", "L3", "total")]
    bench = Bench(windows=True)
    bench.box.begin()
    for seq in range(100):
        bench.box.put_rows([SpooledRow(stream, seq, b'{"k":%d}' % seq) for stream in channels])
    sent = bench.messages()
    assert len(sent) == ROOM.messages and {message.topic for message in sent} == {"acqd/t/window"}
    assert sent[7].payload == b'[{"k":7},{"k":7},{"k":7},{"k":7}]' and bench.box.outstanding == 4 * ROOM.messages
    bench.receipt(0, 99)  # of L1 only
    assert bench.box.outstanding == 3 * ROOM.messages and len(bench.box) == 300 + 36  # L1's other rows were never sent
    bench.box.end()
    bench.box.begin()
    again = bench.messages()
    assert again[0].payload == b'[{"k":0},{"k":0},{"k":0}]'


def test_rows_of_power_quality_travel_alone_on_their_topic_and_have_receipts_of_their_own():
    window, quality = Stream("t", "L1", "boot"), Stream("t", "L1/quality", "boot")
    bench = Bench(windows=True)
    bench.box.begin()
    bench.box.put_rows([SpooledRow(window, 7, b"{}")])
    bench.box.put_rows([SpooledRow(quality, 7, b'{"k":1}'), SpooledRow(quality, 8, b'{"k":2}')])
    sent = [(message.topic, message.payload) for message in bench.messages()]
    alone = [("acqd/t/L1/quality", b'{"k":1}'), ("acqd/t/L1/quality", b'{"k":2}')]
    assert sent == [("acqd/t/window", b"[{}]"), *alone]
    [(topic, payload)] = receipts("s", {quality: Ranges([(7, 7)])})
    bench.box.received(topic, payload, retained=False)
    assert len(bench.box) == 2 and bench.box.outstanding == 2


def test_windows_of_one_channel_do_not_overfill_the_connection():
    bench = Bench(windows=True)
    bench.make(500)
    bench.box.begin()
    bench.sink(retained=True)
    assert len(bench.messages(Room(16, 16))) == 16


def test_a_receipt_for_rows_that_were_never_sent_deletes_none_of_them():
    """Somebody else has published rows with their keys, and the sink has stored those."""
    bench = Bench()
    bench.make(100)
    bench.box.begin()
    probe = bench.take_all()
    bench.receipt(0, 1_000)
    assert len(bench.box) == 100 - len(probe) > 0
    bench.sink()
    assert bench.take_all() == list(range(len(probe), 100))
    bench.receipt(0, 1_000)
    assert len(bench.box) == 0


def test_what_a_receipt_leaves_out_is_sent_again_after_a_while():
    bench = Bench()
    bench.box.begin()
    bench.sink()
    bench.make(10)
    bench.take_all()
    bench.receipt(0, 3)
    bench.receipt(6, 9)
    bench.now += 4
    assert bench.take_all() == []
    bench.now += 2
    assert bench.take_all() == [4, 5] and bench.box.resent == 2
    bench.receipt(4, 5)
    bench.now += 100
    assert bench.take_all() == []


def test_receipts_that_come_late_are_known_before_and_after_rows_are_sent_again():
    bench = Bench()
    bench.box.begin()
    bench.make(1)
    bench.take_all()
    bench.now += 3
    assert bench.box.receipt_lag_s == 0, "nobody says that a sink is there"
    bench.sink(retained=True)
    assert bench.box.receipt_lag_s == 3
    bench.now += 3
    bench.take_all()
    assert bench.box.resent == 1 and bench.box.receipt_lag_s == 5
    bench.receipt(0, 0)
    bench.now += 11
    bench.make(1)
    bench.take_all()
    assert bench.box.receipt_lag_s == 0


def test_late_receipts_are_said_without_a_break_and_not_of_the_time_without_a_sink():
    bench = Bench()
    bench.box.begin()
    bench.sink()
    said = []
    for _ in range(8):  # commits of 2.5 s
        bench.make(1)
        bench.take_all()
        bench.now += 2.5
        said.append(bench.box.receipt_lag_s)
        bench.receipt(0, bench.made)
        bench.now += 0.5
        said.append(bench.box.receipt_lag_s)
    assert min(said) == 2.5
    bench.now += 10
    assert bench.box.receipt_lag_s == 0
    bench.sink(OFFLINE)
    bench.make(1)
    bench.take_all()
    bench.now += 6
    bench.take_all()  # sent again while no sink is there
    bench.sink()
    bench.make(1)
    bench.take_all()
    assert bench.box.receipt_lag_s == 0


def test_how_long_no_sink_is_known_counts_while_the_broker_is_there():
    """Its access rules may hide the sink and its receipts from the daemon."""
    bench = Bench()
    bench.now += 50
    assert not bench.box.alone_s and not Bench("acknowledged").box.alone_s
    bench.box.begin()
    bench.make(2)
    bench.take_all()
    bench.now += 20
    assert bench.box.alone_s == 20
    bench.receipt(0, 0)
    bench.now += 5
    assert bench.box.alone_s == 5
    bench.sink()
    assert not bench.box.alone_s
    bench.sink(OFFLINE)
    bench.now += 7
    assert bench.box.alone_s == 7
    bench.box.end()
    assert not bench.box.alone_s


@pytest.mark.parametrize(
    ("said", "retained", "waiting"),
    [
        (b'{"recall":true}', False, 5),  # of an earlier version
        (b'{"recall":true}', True, 0),
        (b'{"recall":true,"recalled":"a/1"}', False, 5),
        (b'{"recall":true,"recalled":"a/1"}', True, 5),  # the daemon was away then
        (b'{"recalled":"a/1"}', True, 5),
        (b'{"recalled":1}', True, 0),
        (b"{}", False, 0),
    ],
)
def test_a_sink_whose_database_lacks_rows_gets_them_again_once(said, retained, waiting, tmp_path):
    bench = Bench(spool=Spool(tmp_path))
    bench.make(5)
    bench.take_all()
    bench.receipt(0, 4)
    bench.sink(said, retained)
    assert len(bench.box) == waiting
    assert len(bench.take_all()) == waiting
    bench.receipt(0, 4)
    bench.sink(said, retained=True)  # a later connection
    assert len(bench.box) == 0
    bench.sink(b'{"recall":true,"recalled":"a/2"}')
    assert len(bench.box) == 5


def run(name, after, begun, now, database="d"):
    return Commits(database, name, after, begun, now)


PUT_BACK = {
    "to the end of the run before": [run("a", "", 0, 9), run("b", "a", 9, 12), run("c", "a", 9, 10)],
    "into a run": [run("a", "", 0, 9), run("b", "a", 5, 6)],
    "to the same snapshot again": [
        run("a", "", 0, 9), run("b", "a", 9, 12), run("c", "a", 9, 13), run("d", "a", 9, 14), run("e", "a", 9, 14)
    ],
    "back, then to a later snapshot": [run("a", "", 0, 30), run("b", "a", 12, 20), run("c", "a", 25, 26)],
    "past a run that wrote for others": [run("a", "", 0, 9), run("c", "b", 7, 8)],
    "one of two databases": [run("a", "", 0, 9), run("x", "", 0, 50, "e"), run("b", "a", 5, 6)],
}  # fmt: skip
TIMES = {"to the same snapshot again": 3, "back, then to a later snapshot": 2}


@pytest.mark.parametrize("case", PUT_BACK)
def test_a_sink_that_was_put_back_as_a_whole_gets_the_rows_that_its_database_has_forgotten(case, tmp_path):
    said, times = PUT_BACK[case], TIMES.get(case, 1)
    bench, found = Bench(spool=Spool(tmp_path, Limits(keep_s=600.0))), 0
    for seq, commits in enumerate(said):
        bench.make()
        bench.take_all()
        bench.receipt(seq, seq, commits)
        if len(bench.box):
            assert len(bench.box) == seq, "all but the row of this receipt"
            bench.now += 2.0  # the backlog pauses while a sink works through what the broker had for it
            assert bench.take_all() == list(range(seq))
            bench.receipt(0, seq, commits)
            found += 1
    assert (found, bench.box.gone_back, len(bench.box)) == (times, times, 0)


FIRST = run("a", "", 0, 9)
HEALTHY = {
    "starts": [FIRST, run("b", "a", 9, 12), run("c", "b", 12, 13)],
    "starts that wrote for others": [FIRST, run("c", "b", 12, 13)],
    "receipts that overtake each other": [FIRST, run("b", "a", 9, 11), run("a", "", 0, 8), run("b", "a", 9, 10)],
    "two databases by turns": [FIRST, run("x", "", 0, 2, "e"), run("a", "", 0, 10), run("y", "x", 2, 3, "e")],
    "two sinks of one name in one database": [FIRST, run("b", "a", 9, 10), run("c", "b", 10, 11)],
    "restored, which the sink has said": [FIRST, run("b", "", 9, 6), run("b", "", 9, 7), run("c", "b", 7, 8)],
    "an earlier version in between": [FIRST, None, run("b", "a", 12, 13)],
}  # fmt: skip


@pytest.mark.parametrize("said", HEALTHY.values(), ids=HEALTHY)
def test_a_sink_that_goes_on_gets_nothing_twice(said, tmp_path):
    bench = Bench(spool=Spool(tmp_path, Limits(keep_s=600.0)))
    for seq, commits in enumerate(said):
        bench.make()
        bench.take_all()
        bench.receipt(seq, seq, commits)
        assert not len(bench.box) and not bench.box.gone_back


def test_a_new_connection_and_a_new_sink_get_everything_that_waits():
    bench = Bench()
    bench.make(5)
    bench.box.begin()
    assert bench.take_all() == [0, 1, 2, 3, 4]
    bench.sink(retained=True)  # it was subscribed before we came
    assert bench.take_all() == []
    bench.box.end()
    bench.make(2)
    bench.box.begin()
    assert bench.take_all() == list(range(7))
    bench.receipt(0, 5)
    bench.sink()
    assert bench.take_all() == [6]


def test_without_a_sink_new_rows_are_published_and_the_backlog_waits():
    bench = Bench()
    bench.make(1_000)
    bench.box.begin()
    probe = bench.take_all()
    assert len(probe) == 64
    bench.make(3)
    assert bench.take() == [1_000, 1_001, 1_002]
    bench.sink()
    assert bench.take_all() == list(range(1_003))


def test_new_rows_come_before_the_backlog_and_both_in_order():
    bench = Bench()
    bench.make(500)
    bench.box.begin()
    bench.sink()
    old, new = [], []
    for _ in range(20):
        bench.make(2)
        taken = bench.take(Room(30, 20))
        assert taken[:2] == [bench.made - 2, bench.made - 1]
        new += taken[:2]
        old += taken[2:]
    assert old == sorted(old) and old == list(range(len(old))) and len(old) == 20 * 20


def test_the_backlog_is_not_sent_far_ahead_of_its_receipts():
    bench = Bench()
    bench.make(10_000)
    bench.box.begin()
    bench.sink()
    assert len(bench.take_all()) == 4_096
    bench.receipt(0, 99)
    assert len(bench.take_all()) == 100


def test_a_sink_that_works_through_the_brokers_queue_is_not_sent_the_same_again():
    bench = Bench()
    bench.box.begin()
    bench.sink()
    bench.sink(OFFLINE)
    for _ in range(100):
        bench.make(64)
        bench.take()
        bench.now += 1
    bench.box.end()
    bench.box.begin()
    bench.sink(retained=True)
    first = bench.take()
    for start in range(0, 6_400, 100):  # receipts for what an earlier connection has published
        bench.receipt(start, start + 99)
        bench.now += 0.2
        if start >= 4_200:
            assert bench.take_all() == []
    assert len(first) == 64 and len(bench.box) == 0


def test_new_rows_that_a_slow_connection_does_not_take_come_with_the_backlog():
    bench = Bench()
    bench.box.begin()
    bench.sink()
    bench.make(2_500)
    taken = bench.take_all()
    assert sorted(taken) == list(range(2_500))


def test_a_recording_keeps_one_order():
    bench = Bench("acknowledged", live=False)
    bench.box.begin()
    bench.make(300)
    first = bench.take()
    bench.make(10)
    assert first + bench.take_all() == list(range(310))


def test_acknowledged_rows_are_delivered_where_no_sink_is_expected():
    bench = Bench("acknowledged")
    bench.make(200)
    bench.box.begin()
    assert bench.box.subscriptions() == []
    for _ in range(5):
        for message in bench.messages():
            bench.box.acknowledged(message)
    assert len(bench.box) == 0


def test_acknowledged_rows_wait_until_the_broker_says_that_it_takes_rows():
    bench = Bench("acknowledged")
    bench.box.doubt()
    bench.box.begin()

    def acknowledge(count):
        bench.make(count)
        for message in bench.messages():
            bench.box.acknowledged(message)

    acknowledge(20)
    bench.box.ask()
    acknowledge(10)  # while the answer is under way
    assert len(bench.box) == 0 and len(bench.box.spool) == 30
    bench.box.trust()
    bench.messages()
    assert len(bench.box.spool) == 10
    bench.box.ask()
    acknowledge(5)
    bench.box.again()  # refused
    assert bench.take_all() == list(range(20, 35))


def test_a_state_replaces_the_one_that_still_waits():
    bench = Bench()
    for k in range(5):
        bench.box.put_state("acqd/t/status", b"%d" % k)
    bench.box.begin()
    (message,) = bench.messages()
    assert message.payload == b"4" and message.retain


FORGED = b'{"sink":"s","stored":[%s]}'
MANY = b'{"channel":"L1","boot":"b","seq":[%s]}'


@pytest.mark.parametrize(
    "payload",
    [
        b"",
        b"{}",
        b"[1]",
        FORGED % MANY % b"[1]",
        FORGED % b",".join([MANY % b",".join([b"[0,9]"] * 1_500)] * 2),  # more ranges than a sink says at once
        FORGED % MANY % b"[0,9]" + b" " * (256 << 10),  # more bytes
    ],
    ids=["empty", "nothing", "list", "no range", "ranges", "bytes"],
)
def test_a_receipt_that_is_none_is_refused_and_changes_nothing(payload, caplog):
    bench = Bench()
    bench.box.begin()
    bench.make(3)
    bench.box.received("acqd/t/receipt", payload, retained=False)
    assert len(bench.box) == 3 and "cannot be read" in caplog.text


class LossyWay:
    """A broker that forgets, receipts that get lost, connections and sinks that end at any moment."""

    def __init__(self, seed):
        self.chance, self.bench, self.stored, self.online = random.Random(seed), Bench(), set(), False

    def event(self):
        number = self.chance.random()
        if not self.online and number < 0.3:
            self.bench.box.begin()
            self.online = True
        elif self.online and number < 0.05:
            self.bench.box.end()
            self.online = False
        elif number < 0.1:
            self.bench.sink(OFFLINE if self.chance.random() < 0.5 else b"{}")

    def carry(self, room, arrives, comes_back):
        for number in self.bench.take(room):
            if self.chance.random() < arrives:
                self.stored.add(number)
                if self.chance.random() < comes_back:
                    self.bench.receipt(number, number)


@given(seed=st.integers(0, 10**6))
@settings(max_examples=6)
def test_every_row_is_stored_in_the_end_whatever_the_way_loses(seed):
    way = LossyWay(seed)
    bench = way.bench
    for _ in range(300):
        bench.now += way.chance.uniform(0, 2)
        bench.make(way.chance.randrange(4))
        way.event()
        if way.online:
            way.carry(Room(16, 8), 0.7, 0.8)
    if not way.online:
        bench.box.begin()
    for _ in range(100):
        bench.now += 20
        way.carry(ROOM, 1, 1)
    assert way.stored == set(range(bench.made)) and len(bench.box) == 0


class Wire:
    """A line that takes `free` messages more."""

    def __init__(self, free=64):
        self.free, self.sent = free, []

    def room(self):
        return Room(self.free, self.free)

    def send(self, messages):
        self.free -= len(messages)
        self.sent += [int(message.payload) for message in messages]


def test_new_rows_go_straight_to_a_line_that_is_ready_and_takes_them():
    bench, wire = Bench(), Wire(free=2)
    bench.box.begin()
    bench.make()  # the connection is not subscribed yet
    assert bench.take() == [0]
    bench.box.ready(wire)
    bench.make(2)
    assert wire.sent == [1, 2] and bench.take() == [] and bench.box.outstanding == 3
    bench.make()
    assert wire.sent == [1, 2] and bench.take() == [3], "the line is full: by way of the connector"
    bench.box.end()
    wire.free = 64
    bench.make()
    assert wire.sent == [1, 2] and len(bench.box) == 5
    bench.box.begin()
    assert bench.take_all() == [0, 1, 2, 3, 4], "what was sent without a receipt goes again, in order"


def test_rows_that_wait_for_a_slow_line_keep_their_order():
    bench, wire = Bench(), Wire(free=0)
    bench.box.begin()
    bench.box.ready(wire)
    bench.make(2)
    wire.free = 64
    bench.make()
    assert wire.sent == [0, 1, 2] and bench.take() == []


def test_a_way_that_is_slower_than_usual_is_not_filled_with_rows_that_are_already_on_it():
    """Broker or sink stand still for 20 s, then carry a fifth more than is made: they have to catch up."""
    bench, under_way = Bench(), []
    bench.box.begin()
    bench.sink()
    for step in range(460):  # of half a second
        bench.now += 0.5
        bench.make(25)
        under_way += bench.take_all()
        if step >= 40:
            arrived, under_way = Ranges((number, number) for number in under_way[:30]), under_way[30:]
            for pair in arrived:
                bench.receipt(*pair)
    assert len(bench.box) < 50, "thousands where rows are sent again every 5 s"


def test_rows_that_never_get_a_receipt_do_not_hold_up_the_backlog_behind_them():
    """A table that refuses one stream (ADR 90)."""
    bench, refused = Bench(), STREAM._replace(channel="refused")
    for seq in range(AHEAD + 10):
        bench.box.put_rows([SpooledRow(refused, seq, b"-1")])
    bench.make(20)
    bench.box.begin()
    bench.sink()
    taken = []
    for _ in range(3):
        taken += bench.take_all()
        bench.now += LEAST_S + 1
    assert {*range(20)} <= {*taken}
    bench.receipt(0, 19)
    taken = []
    for _ in range(3):
        taken += bench.take_all()
        bench.now += LONGEST_S + 1
    assert taken.count(-1) >= AHEAD + 10, "and all others are sent again"
