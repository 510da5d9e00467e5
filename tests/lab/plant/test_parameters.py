"""Files of plants."""

import pytest

from acqd.errors import InputError
from acqd.lab.plant.parameters import load_plant
from acqd.robot import load_description


def test_a_plant_file_for_another_number_of_axes_is_refused():
    from acqd.lab.plant import parameters

    path = parameters._FOLDER / "ur3e.toml"
    with pytest.raises(InputError, match=r"friction\.coulomb_Nm has 6 values, but iiwa7_r800 has 7 axes"):
        load_plant(load_description("iiwa7_r800"), path)
