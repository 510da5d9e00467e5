"""Every box has a voltage that is 100 %, or the configuration is refused."""

from __future__ import annotations

import pytest

from acqd.daemon.config_file import load_config
from acqd.daemon.nominal import applied
from acqd.errors import InputError

US = '[[source]]\ndevice = "us"\nkind = "replay"\nfile = "a.npz"\nnominal_voltage = 120.0\n'
EU = '[[source]]\ndevice = "eu"\nkind = "replay"\nfile = "b.npz"\n'
ON = "[events]\nenabled = true\n[quality]\nenabled = true\n"


def config(folder, text):
    path = folder / "acqd.toml"
    path.write_text(text)
    return load_config(path)


def voltages(loaded):
    """Of events and of metering, by device."""
    boxes = [applied(loaded.of_source(box)) for box in loaded.sources]
    return {box.device: (box.events.declared_voltage, box.metering.nominal_voltage) for box in boxes}


def test_the_voltage_of_a_box_goes_before_that_of_all(tmp_path):
    loaded = config(tmp_path, ON + "[metering]\nnominal_voltage = 231.0\n" + US + EU.replace("eu", "x")
                    .replace("kind", "nominal_voltage = 400\nkind"))  # fmt: skip
    assert voltages(loaded) == {"us": (120.0, 120.0), "x": (400.0, 400.0)}
    loaded = config(tmp_path, ON.replace("true\n[q", "true\ndeclared_voltage = 230.0\n[q") + US + EU)
    assert voltages(loaded) == {"us": (120.0, 120.0), "eu": (230.0, 230.0)}


def test_a_simulation_has_its_voltage(tmp_path):
    loaded = config(tmp_path, ON + '[[source]]\ndevice = "a"\nvoltage = 120.0\n')
    assert voltages(loaded) == {"a": (120.0, 120.0)}


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[events]\nenabled = true\n", "events: declared_voltage is missing: say what 100 % is in the source of eu"),
        ("[quality]\nenabled = true\n", "quality: the voltage is missing: say what 100 % is in the source of eu"),
    ],
)
def test_a_box_whose_voltage_nobody_says_is_named(tmp_path, text, says):
    with pytest.raises(InputError, match=says):
        config(tmp_path, text + US + EU)
    with pytest.raises(InputError, match=says):
        config(tmp_path, 'device = "eu"\n' + text + EU.replace('[[source]]\ndevice = "eu"', "[source]"))


def test_nothing_is_asked_where_nothing_needs_it_or_the_reference_slides(tmp_path):
    assert voltages(config(tmp_path, US + EU)) == {"us": (120.0, 120.0), "eu": (None, 230.0)}
    loaded = config(tmp_path, "[events]\nenabled = true\nsliding_reference = true\n" + EU)
    assert voltages(loaded)["eu"] == (None, 230.0)
