"""`[alarms]` of acqd.toml."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from acqd.daemon.section import Host, Port
from acqd.energy.budget_section import Budget
from acqd.section import FileName, Section

_Url = Annotated[str, Field(pattern=r"^https?://")]
_Address = Annotated[str, Field(pattern=r"^[^@\s]+@[^@\s]+$")]


class AlarmsSection(Section):
    """Whom `acqd alarms` tells, and how soon."""

    in_working_folder = ("state",)
    webhooks: list[_Url] = Field(default_factory=list, repr=False)
    mail_to: list[_Address] = Field(default_factory=list)
    mail_from: _Address = "acqd@localhost.localdomain"
    smtp_host: Host = "127.0.0.1"
    smtp_port: Port = 25
    smtp_tls: Literal["none", "starttls", "tls"] = "none"
    smtp_username: str | None = None
    smtp_password: str | None = Field(default=None, repr=False)
    delay_s: Annotated[float, Field(ge=0, le=86_400)] = 30.0
    """A state of a daemon is an alarm when it has lasted so long [s]: longer than a restart."""
    budgets: list[Budget] = Field(default_factory=list)
    """Watched by the registers in SQL."""
    remind_h: Annotated[float, Field(ge=0)] = 24.0
    """An alarm that nobody has acknowledged is repeated; 0: never [h]."""
    state: FileName = Path("acqd-alarms.json")
    """Remembers alarms and messages on their way over a restart."""

    @model_validator(mode="after")
    def _whole_login(self) -> AlarmsSection:
        if (self.smtp_username is None) != (self.smtp_password is None):
            raise ValueError("smtp_username and smtp_password belong together: set both or none")
        return self

    @model_validator(mode="after")
    def _different_budgets(self) -> AlarmsSection:
        kinds = [(one.device, one.per, one.unit) for one in self.budgets]
        if twice := [kind for kind in kinds if kinds.count(kind) > 1]:
            device, per, unit = twice[0]
            raise ValueError(f"budgets: two of {device or 'all devices'} in {unit} per {per}; keep one")
        return self


TABLES = {"alarms": AlarmsSection}
