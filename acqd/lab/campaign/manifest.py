"""What a campaign leaves for an analyst (campaign.json), and the truth (truth.json), which the analyst does not see."""

from __future__ import annotations

from typing import Any

from acqd import __version__
from acqd.lab.campaign.bookkeeping import SessionReport
from acqd.lab.campaign.folders import Folders, write_json
from acqd.lab.cell import build_cell
from acqd.lab.effects import EffectSpec, known_effects
from acqd.lab.schedule import SessionPlan
from acqd.lab.settings import CampaignSettings


def write_manifest(
    folders: Folders, settings: CampaignSettings, plans: list[SessionPlan], reports: list[SessionReport]
) -> None:
    """Write what an analyst may know: no undeclared effect, no clock, no true robot, and no seed to derive them."""
    by_session = {report["session"]: report for report in reports}
    manifest = {
        "acqd": __version__,
        "simulated": True,
        "profile": settings.profile,
        "robot": settings.robot,
        "window_s": settings.window_s,
        "log_period_s": settings.recorder.period_s,
        "effects": [_described(effect) for effect in settings.effects if effect.declared],
        "recordings": [entry for plan in plans for entry in _manifest_entries(plan, by_session[plan.name])],
    }
    write_json(folders.out / "campaign.json", manifest)


def _manifest_entries(plan: SessionPlan, report: SessionReport) -> list[dict[str, Any]]:
    return [
        {
            "name": planned.name,
            "space": planned.space,
            "source": planned.source_name,
            "device": report["device"],
            "session": plan.name,
            "boot": report["boot"],
            "log_rows": recording["rows"],
        }
        for planned, recording in zip(plan.recordings, report["recordings"], strict=True)
    ]


def write_truth(folders: Folders, settings: CampaignSettings, reports: list[SessionReport]) -> None:
    """Write everything that really happened: all effects, the plant, the true robots and the session reports."""
    cells = [build_cell(settings, number) for number in range(settings.cells)]
    truth = {
        "acqd": __version__,
        "simulated": True,
        "settings": settings.model_dump(mode="json"),
        "effects": [_described(effect) for effect in settings.effects],
        "plant": cells[0].parameters.model_dump(mode="json"),
        "true_robots": [
            [
                {"joint": joint.name, **joint.link.model_dump(), "rotor_inertia_kgm2": joint.drive.rotor_inertia_kgm2}
                for joint in cell.true_arm.description.joint
            ]
            for cell in cells
        ],
        "sessions": reports,
    }
    write_json(folders.truth / "truth.json", truth)


def _described(spec: EffectSpec) -> dict[str, Any]:
    effect = known_effects()[spec.id]
    return spec.model_dump() | {"about": effect.summary, "values": {**effect.defaults, **spec.values}}
