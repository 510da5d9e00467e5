"""Small data sets to try things out with. All of them are simulated; each is made when it is first asked for, and kept.

>>> from acqd import datasets
>>> before, after = datasets.reference(), datasets.changed("payload:mass_kg=1.5")
>>> before.measured
'simulated'
"""

from __future__ import annotations

import hashlib
import json
import logging
import os
import re
import shutil
from pathlib import Path

from acqd.api.dataset import Dataset
from acqd.errors import UserError, in_our_words
from acqd.extras import LOOP, MOTION, require

_FORM = 1
"""Raised when the same settings give other data."""
_ROBOT = "iiwa7_r800"
_ROBOT_SEED = 1
"""All sets of a type measure one robot: seeds draw its motions and the noise."""
_FEWEST = 2
_KEPT = re.compile(r"-[0-9a-f]{12}$")
"""End of the name of a set."""
_log = logging.getLogger(__name__)


def reference(robot: str = _ROBOT, *, recordings: int = 8, seed: int = 1) -> Dataset:
    """Recordings of a simulated robot in good order, half of them in limited space.

    A recording of about a minute takes some seconds to simulate, the first time. `robot`: a shipped description
    (`acqd robot list`). Raises UserError.
    """
    return _made(robot, recordings, seed, None)


def changed(effect: str = "payload:mass_kg=1.5", robot: str = _ROBOT, *, recordings: int = 6, seed: int = 2) -> Dataset:
    """The same robot with an effect that its description does not say, written as for `acqd lab campaign --undeclared`.

    The effects and their values: `acqd lab effects`. Raises UserError.
    """
    return _made(robot, recordings, seed, effect)


def folder() -> Path:
    """Where the sets are kept: $ACQD_DATASETS, else acqd/datasets in the user's cache folder."""
    chosen = os.environ.get("ACQD_DATASETS")
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return Path(chosen) if chosen else cache / "acqd" / "datasets"


def clear() -> None:
    """Delete all sets that were kept, and nothing else: $ACQD_DATASETS may name a folder with other files."""
    for kept in folder().glob("*"):
        if _KEPT.search(kept.name) and (kept / "ds" / "manifest.json").is_file():
            shutil.rmtree(kept, ignore_errors=True)


def _made(robot: str, recordings: int, seed: int, effect: str | None) -> Dataset:
    require("acqd.datasets", (*LOOP, *MOTION), "loop,lab")
    if recordings < _FEWEST:
        raise UserError(f"recordings = {recordings}: expected {_FEWEST} or more")
    from pydantic import ValidationError

    from acqd.atomic import complete_folder
    from acqd.dataset.build import BuildConfig, build
    from acqd.lab.campaign.run import CampaignConfig, run_campaign
    from acqd.lab.effects import parse_effect
    from acqd.lab.settings import CampaignSettings

    try:
        folder().mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"{folder()}: cannot be made ({error.strerror}); set ACQD_DATASETS to a folder") from None
    hidden = [] if effect is None else [parse_effect(effect, declared=False)]
    limited = (recordings + 1) // 2
    try:
        settings = CampaignSettings(
            robot=robot, seed=seed, robot_seed=_ROBOT_SEED, limited=limited, all_space=recordings - limited,
            effects=hidden,
        )  # fmt: skip
    except ValidationError as error:
        first = error.errors()[0]
        raise UserError(f"{'.'.join(map(str, first['loc']))}: {in_our_words(first['msg'])}") from None
    key = json.dumps([_FORM, settings.model_dump(mode="json")], sort_keys=True).encode()
    what = hidden[0].id if hidden else "reference"
    kept = folder() / f"{Path(robot).stem}-{what}-{hashlib.sha256(key).hexdigest()[:12]}"
    if not kept.exists():
        _log.info("simulating %d recordings of %s, once; they are kept in %s", recordings, robot, kept)
        with complete_folder(kept) as out:
            lab, rows = out / "lab", f"sqlite:///{out}/lab/power.sqlite"
            run_campaign(CampaignConfig(settings, lab, out / "truth", rows, engine="here"), lambda *_: None)
            build(BuildConfig(rows, lab / "logs", out / "ds", robot), lambda *_: None)
            shutil.rmtree(lab)
    return Dataset(kept / "ds")
