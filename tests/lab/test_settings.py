"""lab.toml."""

import re

from acqd.cli.lab.options import settings_from
from acqd.lab.settings import CampaignSettings, LabSettings
from acqd.robot.description import read_toml_table
from tests.places import ROOT


def test_the_settings_file_that_is_shipped_says_the_defaults(tmp_path):
    path = ROOT / "config" / "lab.toml"
    told = CampaignSettings(**read_toml_table(path))
    assert told == CampaignSettings()
    commented = re.sub(
        r"^# (profile|limited|all_space|\w+_sources|assemblies|session|cells) =", r"\1 =", path.read_text(), flags=re.M
    )
    (tmp_path / "lab.toml").write_text(commented)
    assert CampaignSettings(**read_toml_table(tmp_path / "lab.toml")) == CampaignSettings()
    assert settings_from(LabSettings, tmp_path / "lab.toml", {}, []) == LabSettings()
