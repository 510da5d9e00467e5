"""`[web]` of acqd.toml: the live page."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import Field, model_validator

from acqd.daemon.section import Host, Port
from acqd.errors import UserError
from acqd.section import FileName, Section

HeaderName = Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]+$")]
_FEWEST_LETTERS = 20


class ProxySection(Section):
    """`[web.proxy]`: people log in at a reverse proxy, which names them in headers."""

    secret_file: FileName
    """Holds what the proxy sends as X-Acqd-Proxy: without it no header is believed, and no request answered."""
    user_header: HeaderName = "X-Auth-Request-User"
    groups_header: HeaderName = "X-Auth-Request-Groups"
    """Groups are separated by commas."""
    read: list[str] = Field(default=[])
    """Groups that may look."""
    act: list[str] = Field(default=[])
    """Groups that may also search, bring files and replace the model."""

    @model_validator(mode="after")
    def _somebody(self) -> ProxySection:
        if not self.read and not self.act:
            raise ValueError("read and act name no group: nobody could look")
        return self

    def secret(self) -> str:
        """The secret that proxy and page share. Raises UserError."""
        path: Path = self.secret_file
        try:
            secret = path.read_text(encoding="ascii").strip()
        except (OSError, UnicodeDecodeError) as error:
            reason = error.strerror if isinstance(error, OSError) else "expected letters and digits"
            raise UserError(f"[web.proxy] secret_file {path}: cannot be read ({reason})") from None
        if len(secret) < _FEWEST_LETTERS or not secret.isprintable() or " " in secret:
            raise UserError(
                f"[web.proxy] secret_file {path}: expected {_FEWEST_LETTERS} letters or more: openssl rand -hex 20"
            )
        return secret


class WebSection(Section):
    """Where the page is served, and which folders it shows."""

    must_exist = ("reports", "logs", "model")

    enabled: bool = False
    """`acqd run` starts the page in a separate process."""
    host: Host = "127.0.0.1"
    port: Port = 8731
    token: str = Field(default="", repr=False)
    """Asked for in the address; empty: none on loopback, elsewhere a new one per start."""
    proxy: ProxySection | None = None
    """Roles behind a reverse proxy; they replace the token."""
    robot: str = ""
    """Robot whose posture is drawn; empty: none."""
    reports: FileName | None = None
    """Folder with results of `acqd close-loop`; its newest report is shown, and proposals are written there."""
    loop: bool = False
    """Whether the page may search for the cause of an alarm, and replace the model when somebody confirms that."""
    files: bool = False
    """Whether the page takes files of visitors and closes the loop on them; results go to `reports`."""
    files_MB: float = Field(default=500.0, gt=0, le=20_000)
    """Of the files of one visitor at a time; as much again must stay free on the disk."""
    files_kept: Annotated[int, Field(ge=1)] = 50
    files_kept_MB: float = Field(default=2_000.0, gt=0)
    """Number and size of the results of visitors' files in `reports`; beyond either the oldest ones are removed."""
    logs: FileName | None = None
    """Folder of the robot's logs, as for the sidecar."""
    model: FileName | None = None
    """Bundle of the sidecar."""

    @model_validator(mode="after")
    def _paths_of_the_loop(self) -> WebSection:
        missing = [name for name in ("reports", "logs", "model") if getattr(self, name) is None]
        if self.loop and missing:
            raise ValueError(
                f"loop is true, but {' and '.join(missing)} {'is' if len(missing) == 1 else 'are'} not set"
            )
        if self.files and self.reports is None:
            raise ValueError("files is true, but reports is not set")
        return self
