"""Power rows for the span of a log: waits for rows that the sink has not written yet."""

from __future__ import annotations

import time

import sqlalchemy as sa

from acqd.dataset.power import PowerStream, open_power
from acqd.errors import UserError
from acqd.sidecar.log_file import LogFile
from acqd.sidecar.settings import Settings
from acqd.storage import known_rows
from acqd.timestamps import filetime, rfc3339_ms, unix_s

_MARGIN_S = 5.0
_POLL_S = 0.2


class PowerRowsMissingError(Exception):
    """The newest row of the database is older than the end of a log: the sink may be late."""


class PowerRows:
    """The power rows of one database."""

    def __init__(self, settings: Settings, engine: sa.Engine) -> None:
        self._settings, self._engine = settings, engine

    def of_span(self, log: LogFile, clock_lag_s: float) -> PowerStream:
        """Rows around the log's span; `clock_lag_s` is the expected controller minus power clock.

        Waits for the last rows while patience lasts. Raises PowerRowsMissingError, UserError.
        """
        start_s, end_s = log.span_s
        self._wait(log.path.name, end_s, clock_lag_s)
        far = self._settings.clocks_apart_s + _MARGIN_S
        span_ns = (round((start_s - far) * 1e9), round((end_s + far) * 1e9))
        database, device, channel = self._settings.database, self._settings.device, self._settings.channel
        try:
            return open_power(database, device, channel, span_ns, self._engine)
        except UserError as error:
            span = f"{rfc3339_ms(start_s)} to {rfc3339_ms(end_s)}"
            raise UserError(f"{log.path.name}: power rows are missing for {span} ({error})") from None

    def _wait(self, name: str, end_s: float, clock_lag_s: float) -> None:
        """Waits until the rows reach the log's end, or nearly so when patience ends."""
        patience = time.monotonic() + self._settings.patience_s
        while (newest := self._newest(end_s)) is None or newest < end_s - clock_lag_s - _MARGIN_S:
            if time.monotonic() > patience:
                shown = "none" if newest is None else rfc3339_ms(newest)
                raise PowerRowsMissingError(
                    f"{name}: no power rows up to {rfc3339_ms(end_s)} yet, the newest is of {shown}"
                )
            time.sleep(_POLL_S)
        while time.monotonic() < patience and newest is not None and newest < end_s - clock_lag_s:
            time.sleep(_POLL_S)  # the last rows may still be on their way
            newest = self._newest(end_s)

    def _newest(self, end_s: float) -> float | None:
        """UTC [s] of the start of the newest row, of any device if none was named.

        Rows later than now and than the log's end do not count: somebody's row of the year 3000 must not tell that
        all rows of today have arrived.
        """
        latest_s = max(time.time(), end_s) + self._settings.clocks_apart_s + _MARGIN_S
        with self._engine.connect() as connection:
            newest = known_rows.newest(connection, self._settings.device, filetime(round(latest_s * 1e9)))
        return None if newest is None else unix_s(newest)


def device_of(engine: sa.Engine, wanted: str | None, usual: str) -> str:
    """The device whose rows are used: `wanted`, else the only one in the database, else `usual` if it has no rows.

    Raises UserError when the database holds several devices without `usual`.
    """
    if wanted is not None:
        return wanted
    with engine.connect() as connection:
        devices = known_rows.devices(connection)
    if len(devices) > 1 and usual not in devices:
        raise UserError(f"the database holds rows of several devices; choose one with --device: {', '.join(devices)}")
    return devices[0] if len(devices) == 1 else usual
