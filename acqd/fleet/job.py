"""The work on one robot in a worker process: dataset and screen, then the loop. What is done is not done again.

A robot that cannot be judged is a result with `error`: it does not stop the others.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import orjson

from acqd import __version__
from acqd.atomic import write_complete
from acqd.errors import OperationError, UserError
from acqd.fleet.cause import Search, close
from acqd.fleet.dataset import up_to_date
from acqd.fleet.robot import FleetRobot, digest
from acqd.fleet.screen import screen
from acqd.models.bundle.restore import open_model

Result = dict[str, Any]
"""`name`, and `error` or what was found; plain JSON."""
_SCREEN = 2
"""Format of what is kept of a screen: another number screens again."""


@dataclass(frozen=True, slots=True)
class ScreenTask:
    """Bring a robot's dataset up to date and screen it."""

    robot: FleetRobot
    folder: Path


@dataclass(frozen=True, slots=True)
class CauseTask:
    """Close the loop on a robot that has changed."""

    robot: FleetRobot
    folder: Path
    dataset: Path
    screened: Result
    search: Search


def screen_robot(task: ScreenTask) -> Result:
    """Never raises for a fault of the robot's data."""
    return _kept_going(task.robot.name, lambda: _screen(task))


def find_cause(task: CauseTask) -> Result:
    """Never raises for a fault of the robot's data."""
    return _kept_going(task.robot.name, lambda: _cause(task))


def _kept_going(name: str, work: Callable[[], Result]) -> Result:
    try:
        return {"name": name, **work()}
    except (UserError, OperationError) as error:
        return {"name": name, "error": str(error)}
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        return {"name": name, "error": f"{where}{error.strerror or error}"}
    except Exception as error:  # a bug met by the data of one robot must not cost the results of the others
        logging.getLogger(__name__).exception("robot %s", name)
        return {"name": name, "error": f"{type(error).__name__}: {UserError(str(error))}"}


def _screen(task: ScreenTask) -> Result:
    robot = task.robot
    bundle, model = open_model(robot.model)
    description = robot.description or str(bundle.metadata["description"])
    current = up_to_date(robot, task.folder, description, model.step_s)
    manifest = (current.path / "manifest.json").read_bytes() if (current.path / "manifest.json").exists() else b""
    key = digest(
        {
            "acqd": __version__,
            "format": _SCREEN,
            "model": robot.model_digest(),
            "manifest": digest({"text": manifest.hex()}),
        }
    )
    about = {"dataset": str(current.path), "type": bundle.metadata["robot"], "refused": current.refused}
    file = task.folder / "screen.json"
    found = _kept(file, key) or _keep(file, key, screen(robot.model, bundle, model, current.path).as_json())
    return {**about, "screen": found}


def _cause(task: CauseTask) -> Result:
    key = digest(
        {"acqd": __version__, "model": task.robot.model_digest(), "content": task.screened["content"],
         "onset_s": task.screened["onset_s"], "search": asdict(task.search), "robot": task.robot.description}
    )  # fmt: skip
    file = task.folder / "cause.json"
    found = _kept(file, key)
    if found is None or (found["report"] is not None and not Path(found["report"]).exists()):
        found = _keep(file, key, close(task.robot, task.dataset, task.folder, task.screened, task.search))
    return {"cause": found}


def _kept(file: Path, key: str) -> Result | None:
    """What an earlier run found from the same inputs."""
    with suppress(OSError, orjson.JSONDecodeError, KeyError, TypeError):
        stored = orjson.loads(file.read_bytes())
        return dict(stored["result"]) if stored["key"] == key else None
    return None


def _keep(file: Path, key: str, result: Result) -> Result:
    """Write a result completely or not at all, and read it back: a run that continues sees the same numbers."""
    text = orjson.dumps({"key": key, "result": result}, option=orjson.OPT_INDENT_2 | orjson.OPT_SERIALIZE_NUMPY)
    write_complete(file, text)
    return dict(orjson.loads(text)["result"])
