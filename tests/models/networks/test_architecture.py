"""The eight networks of the thesis."""

from acqd.models.networks.architecture import ARCHITECTURES


def test_learnables_are_those_of_appendix_b():
    assert [a.learnables(7) for a in ARCHITECTURES.values()] == [903, 1183, 1463, 1191, 1475, 1481, 1499, 2133]
