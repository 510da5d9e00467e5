"""The robot whose recordings the tests of this room make."""

import pytest

from tests.builders import ROBOT


@pytest.fixture(scope="session")
def robot():
    return ROBOT
