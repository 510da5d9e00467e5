"""Reading acqd.toml: TOML, notes on keys of earlier versions, one line per mistake."""

from __future__ import annotations

import logging
import os
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from acqd.daemon.config import Config
from acqd.daemon.config_complaint import complaint
from acqd.daemon.config_place import as_installed
from acqd.daemon.earlier_files import with_tariff, without_effect
from acqd.daemon.mqtt_section import Service
from acqd.errors import InputError
from acqd.toml_file import tables_of

_log = logging.getLogger(__name__)


def load_config(path: Path, service: Service = "daemon") -> Config:
    """Read and check a configuration file, which logs in at the broker as `service` does.

    Raises InputError with one line per mistake.
    """
    data = read_toml(path)
    config = parsed_config(data, path)
    own = data.get("energy", {}).get("tariff")  # by hand, a command may be in another folder than the services
    if own is not None and config.energy.tariff is not None:
        config.energy = config.energy.model_copy(update={"tariff": path.absolute().parent / own})
    state = os.environ.get("STATE_DIRECTORY")
    if config.state_dir is None and state:
        config.state_dir = Path(state)
    as_installed(config, path)
    config.mqtt = config.mqtt.of(service)
    return config


def read_toml(path: Path) -> dict[str, Any]:
    """The tables of a file. Raises InputError."""
    try:
        return tables_of(path)
    except FileNotFoundError:
        raise InputError(path, "no such file; acqd config init writes a complete one") from None
    except PermissionError:
        raise InputError(path, "cannot be read (Permission denied); may this user read it (sudo)?") from None
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror}); expected a file of TOML") from None
    except InputError as error:
        if "source]" not in str(error):
            raise
        problem = str(error).removeprefix(f"{path}: ")
        raise InputError(path, f"{problem}; several sources are all written as [[source]]") from None


def parsed_config(data: dict[str, Any], path: Path) -> Config:
    """The configuration that tables mean; `path` is named by messages. Raises InputError with one line per mistake."""
    if plural := [key for key in ("sources", "boxes") if key in data]:
        raise InputError(path, f"unknown key {plural[0]}; several sources are written as [[source]] tables")
    data, notes = without_effect(data)
    data, more = with_tariff(data, path)
    for note in notes + more:
        _log.warning("%s: %s", path, note)
    try:
        return Config.model_validate(data)
    except ValidationError as error:
        raise InputError(path, "; ".join(complaint(fault) for fault in error.errors())) from None
