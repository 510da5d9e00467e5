"""Database URLs: understood, and shown without anything that may be a secret."""

from __future__ import annotations

import sqlalchemy as sa
from sqlalchemy.engine import URL, make_url

from acqd.errors import UserError

_EXPECTED = (
    "expected sqlite:///path, a path or postgresql://user@host/name; in a password, write @ as %40, : as %3A, / as %2F"
)
_DRIVERS = ("sqlite", "postgresql+psycopg")


def parse_url(url: str) -> URL:
    """A URL, or a plain path of a SQLite file. Raises UserError, whose text repeats nothing of the URL.

    Where a URL is mistyped, a part of the password may stand at any place of it.
    """
    if "://" not in url:
        if "@" in url:
            raise UserError(f"the database cannot be understood; {_EXPECTED}")
        return URL.create("sqlite", database=url)
    try:
        parsed = make_url(url)
    except (sa.exc.ArgumentError, ValueError):
        raise UserError(f"the database URL cannot be understood; {_EXPECTED}") from None
    if parsed.drivername in ("postgresql", "postgres"):
        parsed = parsed.set(drivername="postgresql+psycopg")
    sqlite = parsed.drivername == "sqlite"
    if sqlite and "?" in url:
        raise UserError("the database URL of a file holds a ?, which begins options there; give the path alone")
    odd = (parsed.host or parsed.username or parsed.password) if sqlite else "@" in f"{parsed.host}{parsed.database}"
    if parsed.drivername not in _DRIVERS or odd:
        raise UserError(f"the database URL is of an unknown kind or a special character is not escaped; {_EXPECTED}")
    return parsed


def shown(url: URL | str) -> str:
    """A database for messages and reports: kind, host and name, without user, password and options."""
    if isinstance(url, str):
        if "://" not in url:
            return url
        url = parse_url(url)
    if url.get_backend_name() == "sqlite":
        return str(url.database or ":memory:")
    port = f":{url.port}" if url.port else ""
    return f"postgresql://{url.host or ''}{port}/{url.database or ''}"
