"""The archive that a configuration asks for."""

from __future__ import annotations

from typing import TYPE_CHECKING

from acqd.daemon.config import Config
from acqd.errors import UserError

if TYPE_CHECKING:  # libsndfile is loaded only where samples are kept
    from acqd.archive.recorder import Recorder


def archive_of(config: Config) -> Recorder | None:
    """None where no samples are kept. Raises UserError where it cannot be used."""
    if not config.archived:
        return None
    from acqd.archive.recorder import Recorder
    from acqd.archive.ring import Limits

    section = config.archive
    place = section.place(config.state_dir, config.device)
    if place is None:
        raise UserError("[archive] enabled: nobody says where; set [archive] folder, or state_dir")
    limits = Limits(int(section.max_gb * 1e9), section.max_days * 86_400.0, int(section.keep_free_gb * 1e9))
    return Recorder(place, limits)
