"""Shared causes: found in simulated findings, and not where findings have nothing in common."""

import numpy as np
import pytest

from acqd.fleet.scan import Finding, _likeliest, _ratio, clusters
from acqd.models.effects import library

HOUR = 3600.0
WEEK = 168 * HOUR
KINDS = tuple(library())
RATES = dict.fromkeys(library(), 1.0)
LENGTHS = [HOUR, 8 * HOUR, 24 * HOUR, WEEK]


def finding(number, kind, onset_s):
    return Finding(f"r{number:03d}", kind, onset_s, 0.0, 4 * WEEK)


def by_chance(random, count, kinds=KINDS):
    return [finding(k, str(random.choice(kinds)), float(random.uniform(0, 4 * WEEK))) for k in range(count)]


def found(findings, weights=RATES, chance=0.01):
    return clusters(findings, weights, LENGTHS, chance, 1)


def test_a_cause_of_many_robots_at_one_time_is_one_cluster_with_its_robots():
    random = np.random.default_rng(1)
    shared = [finding(100 + k, "viscous_friction", WEEK + 600.0 * k) for k in range(6)]
    others = by_chance(random, 10, ("payload", "copper_loss", "viscous_friction"))
    (cluster,) = found([*others, *shared])
    assert cluster.kind == "viscous_friction" and set(cluster.robots) >= {each.robot for each in shared}
    assert cluster.window_s[0] >= WEEK - HOUR and cluster.p <= 0.01 and cluster.expected < 1


def test_a_cause_is_shared_where_nobody_knows_since_when():
    shared = [finding(k, "supply_efficiency", None) for k in range(8)]
    others = [finding(100 + k, kind, None) for k, kind in enumerate(("payload", "copper_loss", "offset_shift"))]
    (cluster,) = found([*others, *shared])
    assert len(cluster.robots) == 8 and cluster.window_s is None


def test_two_shared_causes_are_two_clusters():
    first = [finding(k, "viscous_friction", WEEK + 60.0 * k) for k in range(8)]
    second = [finding(100 + k, "supply_efficiency", 2 * WEEK + 60.0 * k) for k in range(5)]
    assert {each.kind for each in found([*first, *second])} == {"viscous_friction", "supply_efficiency"}


def test_findings_by_chance_are_shared_as_rarely_as_asked_for():
    random = np.random.default_rng(3)
    clustered = sum(bool(found(by_chance(random, 12), chance=0.05)) for _ in range(12))
    assert clustered <= 3  # 0.6 expected


def test_a_cause_that_is_usual_needs_more_robots():
    findings = [finding(k, "payload", None) for k in range(4)] + [finding(9, "copper_loss", None)]
    assert found(findings)
    assert not found(findings, RATES | {"payload": 40.0})


@pytest.mark.parametrize("count", [0, 1])
def test_a_single_finding_is_not_shared(count):
    assert found([finding(k, "payload", WEEK) for k in range(count)]) == []


def test_the_ratio_is_kulldorffs():
    assert _ratio(5, 1.0, 10) == pytest.approx(5 * np.log(5) + 5 * np.log(5 / 9))
    assert _ratio(5, 5.0, 10) == 0.0 and _ratio(1, 0.1, 10) == 0.0
    assert _ratio(4, 1.0, 4) == pytest.approx(4 * np.log(4))


def test_the_window_begins_and_ends_with_an_onset():
    onsets = (WEEK, WEEK + 600, WEEK + 1200, 3 * WEEK)
    best, _ = _likeliest([finding(k, "payload", t) for k, t in enumerate(onsets)], {"payload": 1.0}, LENGTHS)
    assert best.window_s == (WEEK, WEEK + 1200) and best.robots == ("r000", "r001", "r002")
