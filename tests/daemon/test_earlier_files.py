"""Configuration files of earlier versions are read, with a note."""

from __future__ import annotations

import pytest

from acqd.daemon.config import load_config
from acqd.errors import InputError

FIRST = 'device = "acqd"\n[source]\nkind = "simulated"\nphases = 3\nloops = {loops}\n[mqtt]\nqueue = 100000\n'


def test_the_block_of_the_first_version_is_read_with_a_note(tmp_path, caplog):
    path = tmp_path / "acqd.toml"
    path.write_text(FIRST.format(loops=1))
    assert load_config(path).source.kind == "simulated"
    [note] = caplog.messages
    assert str(path) in note and "source.loops" in note and "has no effect" in note


@pytest.mark.parametrize("loops", ["0", "true", "1.0"])
def test_a_key_of_another_kind_with_another_value_is_refused(tmp_path, loops):
    path = tmp_path / "acqd.toml"
    path.write_text(FIRST.format(loops=loops))
    with pytest.raises(InputError, match=r"source\.loops belongs to kind replay"):
        load_config(path)
