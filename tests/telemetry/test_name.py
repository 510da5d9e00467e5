"""Who publishes under a name: two daemons, any order of arrival. Time is virtual."""

from __future__ import annotations

import orjson
import pytest

from acqd.telemetry.ask import Ask, Claimant, encode
from acqd.telemetry.name import Name
from acqd.telemetry.topics import OFFLINE


class Broker:
    """Retains the status, and delivers everything to everybody, also to the sender."""

    def __init__(self):
        self.now, self.status, self.names = 100.0, None, []

    def join(self, instance, boot="b1", since="2026-01-01T00:00:00Z", taken=False):
        name = Name(Claimant(instance, boot, f"host of {instance}", since, taken), lambda: self.now)
        self.names.append(name)
        name.begin()
        if self.status is not None and name.heard_status(self.status, retained=True):
            self.publish(name)
        return name

    def publish(self, name):
        self.send(orjson.dumps({"name": {key: getattr(name.me, key) for key in Claimant.__struct_fields__}}))

    def send(self, status):
        self.status = status
        for name in self.names:
            if name.heard_status(status, retained=False):
                self.publish(name)

    def run(self, seconds):
        """Time goes on; who has the name publishes its status every 10 s."""
        for _ in range(int(seconds * 4)):
            self.now += 0.25
            for name in self.names:
                if name.turn() or (name.held and self.now % 10 == 0):
                    self.publish(name)
                if (question := name.question()) is not None:
                    for other in self.names:
                        if other.heard_ask(question):
                            self.publish(other)


@pytest.fixture
def broker():
    return Broker()


def test_a_name_that_nobody_has_is_taken_within_half_a_second(broker):
    name = broker.join("a")
    assert not name.held
    broker.run(0.5)
    assert name.held and not name.trouble


def test_a_copy_of_the_disk_stands_by_although_the_broker_has_kept_a_status_of_its_id(broker):
    first = broker.join("a", "b1")
    broker.run(1)
    copy = broker.join("a", "b2", "2026-01-01T00:01:00Z")
    broker.run(3)
    assert first.held and not copy.held and "b1" in copy.trouble and "b2" in first.trouble


def test_the_newcomer_stands_by_and_both_name_the_other(broker):
    first = broker.join("a")
    broker.run(30)
    second = broker.join("b", since="2025-01-01T00:00:00Z")  # its clock is behind: that makes it no senior
    broker.run(300)
    assert first.held and not second.held
    assert "host of b" in first.trouble and "boot b1" in first.trouble and "since 2025" in first.trouble
    assert "host of a" in second.trouble and "rows wait" in second.trouble


@pytest.mark.parametrize("farewell", [True, False])
def test_the_newcomer_begins_when_the_first_one_has_gone(broker, farewell):
    first = broker.join("a")
    broker.run(5)
    second = broker.join("b")
    broker.run(20)
    broker.names.remove(first)
    if farewell:
        broker.send(OFFLINE)
    broker.run(30)
    assert second.held and not second.trouble


def test_a_status_that_the_broker_has_kept_of_a_daemon_that_is_gone_delays_the_start(broker):
    first = broker.join("a")
    broker.run(5)
    broker.names.remove(first)
    second = broker.join("b")
    broker.run(5)
    assert not second.held
    broker.run(10)
    assert second.held and not second.trouble


def test_a_restart_of_the_same_installation_waits_for_nobody(broker):
    broker.join("a")
    broker.run(5)
    broker.names.clear()  # killed: the broker has not noticed
    again = broker.join("a", boot="b2")
    broker.run(0.5)
    assert again.held
    broker.send(OFFLINE)  # the last will of the earlier connection comes late
    assert again.held and broker.status != OFFLINE


def test_a_person_decides_for_the_newcomer(broker):
    first = broker.join("a")
    broker.run(5)
    second = broker.join("b", since="2027", taken=True)
    broker.run(20)
    assert second.held and not first.held and "rows wait" in first.trouble
    broker.run(300)
    assert second.held and not first.held


@pytest.mark.parametrize("instances", [("a", "b"), ("a", "a")])  # the same: a copied disk
def test_of_two_that_began_at_once_the_earlier_one_stays(broker, instances):
    """Both have published before either heard the other, as after an outage of the network."""
    names = [broker.join(one, f"b{k}", f"2026-01-0{k + 1}") for k, one in enumerate(instances)]
    for name in names:
        name.turn()
    broker.now += 1
    for name in names:
        assert name.turn()
    broker.publish(names[1])
    broker.run(20)
    assert [name.held for name in names] == [True, False]
    assert all(name.rival is not None for name in names)


def test_what_is_no_daemon_of_the_name_takes_nothing(broker):
    name = broker.join("a")
    broker.run(1)
    for payload in (b"{", b"[]", b'{"state":"online","source":"replay"}', b'{"name":3}', b"null"):
        assert not name.heard_status(payload, retained=False)
        assert not name.heard_ask(payload)
    assert not name.heard_ask(encode(Ask("last_rows", "b")))
    assert name.held and name.rival is None
    assert name.heard_status(b'{"state":"online","boot":"b9","started":"2027"}', retained=False), "an earlier acqd"
