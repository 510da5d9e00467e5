"""Watching a dataset that grows."""

from pathlib import Path

import pytest

from acqd.discrepancy.config import CloseConfig
from acqd.discrepancy.monitor.watch import Watch
from acqd.errors import InputError
from acqd.models.bundle.bundle import load_bundle


@pytest.mark.long(seconds=8)
def test_a_watch_raises_the_alarm_proposes_and_goes_on_after_a_restart(closed, tmp_path):
    folder, _ = closed
    order = CloseConfig(folder / "now" / "ds", folder / "model", tmp_path / "watch", only=("payload", "offset_shift"))
    events = list(Watch(order, 200 * 3600.0).look(lambda *_: None))
    kinds = [event.kind for event in events]
    assert kinds.count("recording") == 12 and kinds.count("alarm") == 1
    proposal = events[-1].details
    assert [effect["id"] for effect in proposal["effects"]] == ["payload"]
    assert load_bundle(Path(proposal["out"]) / "model").metadata["effects"]
    again = Watch(order, 200 * 3600.0)
    assert again.resumed.details["proposed"] and again.resumed.details["alarm"]["onset_s"] < 1e9 + 9000 + 180
    assert list(again.look(lambda *_: None)) == []  # nothing twice
    (order.out / "watch.json").write_text("{")
    with pytest.raises(InputError, match="delete it to start again"):
        Watch(order, 200 * 3600.0)
