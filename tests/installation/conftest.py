import pytest

from tests.installation.roots import bare


@pytest.fixture
def root(tmp_path):
    """A system where mosquitto is installed."""
    return bare(tmp_path)
