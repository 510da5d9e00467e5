"""Configuration files of earlier versions are read, with a note."""

from __future__ import annotations

import pytest

from acqd.daemon.config_file import load_config
from acqd.errors import InputError
from acqd.installation.config_upgrade import planned

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


def test_the_tariff_of_the_page_is_that_of_all_costs_and_is_moved(tmp_path, caplog):
    path = tmp_path / "acqd.toml"
    path.write_text('[web]\ntariff = "/etc/acqd/t.toml"  # of the works\nport = 9000\n')
    assert str(load_config(path).energy.tariff) == "/etc/acqd/t.toml" and "config upgrade" in caplog.text
    upgrade = planned(path)
    assert upgrade.needed and "[energy]" in upgrade.after and "energy.tariff" in upgrade.notes[0]
    path.write_text(upgrade.after)
    assert load_config(path).energy.tariff is not None and load_config(path).web.port == 9000
    path.write_text('[web]\ntariff = "a.toml"\n[energy]\ntariff = "b.toml"\n')
    with pytest.raises(InputError, match="name different files"):
        load_config(path)


def test_a_relative_tariff_lies_next_to_the_file(tmp_path):
    path = tmp_path / "acqd.toml"
    path.write_text('[energy]\ntariff = "t.toml"\n')
    assert load_config(path).energy.tariff == tmp_path / "t.toml"


def test_a_tariff_of_the_working_folder_is_found_and_moved_with_its_place(tmp_path, monkeypatch):
    (tmp_path / "etc").mkdir()
    (tmp_path / "t.toml").write_text("price = 0.2\n")
    path = tmp_path / "etc" / "acqd.toml"
    path.write_text('[web]\ntariff = "t.toml"\n')
    monkeypatch.chdir(tmp_path)
    assert load_config(path).energy.tariff == tmp_path / "t.toml"
    path.write_text(planned(path).after)
    monkeypatch.chdir("/")
    assert load_config(path).energy.tariff == tmp_path / "t.toml"
