"""The bench of each kind of source in turn."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack

import pytest

from tests.doubles.veth import may_create_veth
from tests.sources.bench import Bench
from tests.sources.benches import KINDS


@pytest.fixture(params=KINDS)
def bench(request: pytest.FixtureRequest) -> Iterator[Bench]:
    if request.param in ("ethercat", "sampled-values") and not may_create_veth():
        pytest.skip("veth pairs need CAP_NET_ADMIN (root, or a user namespace)")
    with ExitStack() as stack:
        made = KINDS[request.param](stack)
        made.connect()
        yield made
