"""The repository and the recordings next to it, which a stranger's clone does not have."""

from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
WAVEFORMS = ROOT.parent / "shared" / "data" / "waveforms"
ROBOT_LOGS = ROOT.parent / "shared" / "data" / "robots"

needs_robot_logs = pytest.mark.skipif(not ROBOT_LOGS.is_dir(), reason=f"no robots' logs at {ROBOT_LOGS}")
COMPLAINTS = ROOT.parent / "shared" / "data" / "complaints" / "robot"
needs_complaints = pytest.mark.skipif(not COMPLAINTS.is_dir(), reason=f"no inputs that misled acqd at {COMPLAINTS}")
"""Small inputs that misled acqd, with what is right in their README."""
