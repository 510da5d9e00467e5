"""modelDescription.xml."""

import pytest


@pytest.mark.long(seconds=20)
@pytest.mark.parametrize("version", [pytest.param("2.0", marks=pytest.mark.slow), "3.0"])
def test_fmpy_finds_nothing_to_complain_of(made, version):
    validation = pytest.importorskip("fmpy.validation")
    assert validation.validate_fmu(str(made("effects", version)[1])) == []
