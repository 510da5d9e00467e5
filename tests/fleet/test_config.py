"""A fleet's file: defaults, places, and one complaint per bad key."""

import pytest

from acqd.errors import InputError
from acqd.fleet.config import read_fleet


def written(folder, text):
    path = folder / "plant.toml"
    path.write_text(text)
    return path


GOOD = """
[fleet]
false_discoveries = 0.1
[defaults]
model = "models/{name}"
power = "{name}/power.sqlite"
logs = "{name}/logs"
robot = "ur10e"
[robots.r-001]
[robots.r-002]
power = "postgresql://db/acqd"
device = "cell-2"
lag_s = 0.5
[robots.r-003]
dataset = "/data/{name}"
robot = "mine/arm.toml"
"""


def test_defaults_hold_for_all_robots_and_paths_are_relative_to_the_file(tmp_path):
    fleet = read_fleet(written(tmp_path, GOOD))
    first, second, third = fleet.robots
    assert fleet.settings.false_discoveries == 0.1
    assert first.model == tmp_path / "models" / "r-001" and first.power == str(tmp_path / "r-001" / "power.sqlite")
    assert (second.power, second.device, second.lag_s) == ("postgresql://db/acqd", "cell-2", 0.5)
    assert second.logs == tmp_path / "r-002" / "logs" and second.description == "ur10e"
    assert str(third.dataset) == "/data/r-003" and third.power is None and third.logs is None
    assert third.description == str(tmp_path / "mine" / "arm.toml")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "names no robots"),
        ("robots = 3", "names no robots"),
        ("[robots.a]", "robots.a.model is missing"),
        ("[robots.a]\nmodel = 'm'", "robots.a.power is missing: SQL URL or file of power rows, or a dataset"),
        ("[robots.a]\nmodel = 'm'\ndataset = 'd'\nlogs = 'l'", "robots.a.dataset: excludes power and logs"),
        ("[robots.a]\nmodle = 'm'", "robots.a.modle: there is no such key"),
        ("[robots.a]\nlag_s = 'x'", "robots.a.lag_s: "),
        ("[robots.a]\ncut = -1", "robots.a.cut: "),
        ("[robots.'a/b']\nmodel = 'm'", "robots.a/b: expected a name"),
        ("[robots]\na = 3", "robots.a: expected a table"),
        ("[defaults]\ntorque = 'x'\n[robots.a]", "defaults.torque: "),
        ("[fleet]\nfalse_discoveries = 2\n[robots.a]", "fleet.false_discoveries: "),
        ("[fleet]\nmethod = 'holm'\n[robots.a]", "fleet.method: "),
        ("[fleet]\nonly = ['paylod']\n[robots.a]", "fleet.only: no effect 'paylod'; the effects are "),
        ("[fleet.base_rates]\npaylod = 2\n[robots.a]", "fleet.base_rates: no effect 'paylod'"),
        ("[robot.a]\nmodel = 'm'", "names no robots"),
        ("[default]\nmodel = 'm'\n[robots.a]", "default: there is no such table"),
        ("[robots.a", "is not valid TOML"),
    ],
)
def test_a_mistake_names_file_robot_and_key(tmp_path, text, said):
    with pytest.raises(InputError) as raised:
        read_fleet(written(tmp_path, text))
    assert str(raised.value).startswith(f"{tmp_path / 'plant.toml'}: ") and said in str(raised.value)


def test_every_bad_key_is_named_once(tmp_path):
    robots = "\n".join(f"[robots.r{k}]" for k in range(50))
    text = f"[defaults]\nmodel = 'm'\ndataset = 'd'\nsearch_s = 0\n{robots}\nlag = 1\n"
    with pytest.raises(InputError) as raised:
        read_fleet(written(tmp_path, text))
    assert str(raised.value).count("search_s") == 1 and "robots.r49.lag: there is no such key" in str(raised.value)


def test_of_many_mistakes_the_first_are_named_and_the_others_counted(tmp_path):
    text = "\n".join(f"[robots.r{k}]\nlag = 1" for k in range(50))
    with pytest.raises(InputError, match=r"and \d+ more$"):
        read_fleet(written(tmp_path, text))


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match=r"none\.toml: no such file"):
        read_fleet(tmp_path / "none.toml")
