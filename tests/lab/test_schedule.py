"""The order of sessions."""

import itertools

from acqd.lab.schedule import plan_sessions
from acqd.lab.settings import CampaignSettings


def test_sessions_take_turns_with_the_sources_and_never_overlap():
    plans = plan_sessions(CampaignSettings())
    recordings = [recording for plan in plans for recording in plan.recordings]
    assert len(recordings) == 337
    assert [recording.number for recording in recordings] == list(range(1, 338))
    assert {recording.source_name for recording in recordings if recording.space == "all"} == {
        f"all_{number:02d}" for number in range(1, 31)
    }
    for before, after in itertools.pairwise(plans):
        assert after.start_s - before.start_s >= len(before.recordings) * 250
