"""What the sidecar stores."""

from dataclasses import replace

import numpy as np
import pytest

from acqd.sidecar.store import Done, Store
from acqd.storage.database import open_database


def test_nothing_of_a_log_stays_when_it_cannot_be_committed_whole(tmp_path):
    store = Store(open_database(str(tmp_path / "s.sqlite")))
    stamps = np.array([1, 2, 2])  # the key refuses the third
    bad = Done("a", "a.log", "m", "ok", {}, stamps, np.zeros(3), np.zeros(3))
    with pytest.raises(Exception, match="UNIQUE"):
        store.commit(bad, {"sidecar": {"x": 1}})
    assert store.status("a") is None and store.memory("sidecar") is None
    store.commit(replace(bad, filetime=np.array([1, 2, 3])), {"sidecar": {"x": 1}})
    assert store.status("a") == "ok" and store.memory("sidecar") == {"x": 1}
