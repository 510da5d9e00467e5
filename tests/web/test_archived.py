"""A second of the past: the samples of the archive as the scope shows them."""

import numpy as np
import orjson
import pytest

from acqd.web.archived import second
from acqd.web.scope import ScopeError
from tests.archive.box import FORM, UTC, FakeBox, mains, recorder

CODES = mains(3.0)


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    root = tmp_path_factory.mktemp("archive")
    archive = recorder(root, segment_s=1.1)
    box = FakeBox(archive)
    box.feed(CODES[:44_000])
    box.feed(CODES[48_000:60_000], at=48_000)
    box.track.finish()
    archive.close()
    return root


def test_a_second_has_the_peaks_of_its_samples_and_figures_of_its_middle(place):
    picture = second(place, "box", UTC / 1e9 + 1)  # over two segments
    traces, part = picture["traces"], CODES[20_000:40_000] * np.array(FORM.scale)
    assert max(traces["U1"]) == pytest.approx(part[:, 0].max(), rel=1e-3)
    assert min(traces["I3"]) == pytest.approx(part[:, 5].min(), rel=1e-3)
    assert len(picture["ms"]) == len(traces["U1"]) == 2000 and picture["ms"][-1] == pytest.approx(999.95)
    middle = part[8_000:12_000, 0]
    assert picture["figures"]["U1"]["rms"] == pytest.approx(np.sqrt((middle**2).mean()), rel=1e-3)
    assert picture["f"] == pytest.approx(50.01, abs=0.02) and not picture["broken"]
    assert orjson.dumps(picture)


def test_what_is_missing_is_said(place):
    assert second(place, "box", UTC / 1e9 + 2)["broken"]
    with pytest.raises(ScopeError, match="has no samples of box at 2026"):
        second(place, "box", UTC / 1e9 + 60)
    with pytest.raises(ScopeError, match="not enabled"):
        second(None, "box", UTC / 1e9)
    with pytest.raises(ScopeError, match="no such folder"):
        second(place / "nowhere", "box", UTC / 1e9)
