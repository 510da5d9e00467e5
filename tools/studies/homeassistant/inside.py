"""Home Assistant without its pages, answering questions on stdin: run by the study in Home Assistant's environment.

Imports nothing of acqd. Each line of stdin is a JSON list [command, arguments ...], each line of stdout its answer.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import sys
from collections.abc import Iterator
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

from homeassistant import bootstrap, core, loader  # type: ignore[import-not-found,unused-ignore]
from homeassistant.components import recorder  # type: ignore[import-not-found,unused-ignore]
from homeassistant.components.energy import data as energy  # type: ignore[import-not-found,unused-ignore]
from homeassistant.components.energy import validate  # type: ignore[import-not-found,unused-ignore]
from homeassistant.components.recorder import statistics, tasks  # type: ignore[import-not-found,unused-ignore]
from homeassistant.helpers import entity_registry  # type: ignore[import-not-found,unused-ignore]
from homeassistant.util import dt  # type: ignore[import-not-found,unused-ignore]


async def start(folder: str, http_port: int) -> Any:
    """Set Home Assistant up from a folder, which it fills itself the first time."""
    hass = core.HomeAssistant(folder)
    hass.config.skip_pip = True
    loader.async_setup(hass)
    config: dict[str, Any] = {
        "homeassistant": {"name": "study", "time_zone": "UTC"},
        "http": {"server_host": "127.0.0.1", "server_port": http_port},
        "recorder": {"commit_interval": 0},
        "sensor": {},
        "energy": {},
    }
    Path(folder, "configuration.yaml").write_text(json.dumps(config))  # the integration reads it again
    await bootstrap.async_from_config_dict(config, hass)
    await hass.async_start()
    return hass


class Answers:
    """The commands."""

    def __init__(self, hass: Any) -> None:
        self._hass = hass

    async def connect(self, host: str, port: int) -> Any:
        """Add the MQTT integration as a user does, by its dialogue."""
        flow = await self._hass.config_entries.flow.async_init("mqtt", context={"source": "user"})
        answers = {"broker": host, "port": port}
        result = await self._hass.config_entries.flow.async_configure(flow["flow_id"], answers)
        await self._hass.async_block_till_done()
        return str(result["type"])

    async def states(self) -> Any:
        """Every entity that the MQTT integration knows: state, attributes, whether a user has to enable it."""
        registry = entity_registry.async_get(self._hass)
        return {
            entry.entity_id: self._entity(entry) for entry in registry.entities.values() if entry.platform == "mqtt"
        }

    def _entity(self, entry: Any) -> dict[str, Any]:
        state = self._hass.states.get(entry.entity_id)
        return {
            "unique_id": entry.unique_id,
            "disabled": entry.disabled,
            "state": state.state if state else None,
            "attributes": {key: str(value) for key, value in state.attributes.items()} if state else {},
        }

    async def statistics(self, entity: str) -> Any:
        """What the recorder makes of an entity in the running period of five minutes."""
        instance = recorder.get_instance(self._hass)
        now = dt.utcnow()
        period = now.replace(minute=now.minute - now.minute % 5, second=0, microsecond=0)
        await instance.async_block_till_done()
        instance.queue_task(tasks.StatisticsTask(period, False))
        await instance.async_block_till_done()
        known = await instance.async_add_executor_job(statistics.list_statistic_ids, self._hass, {entity})
        rows = await instance.async_add_executor_job(self._rows, entity, period)
        return {"about": known, "rows": rows}

    def _rows(self, entity: str, period: datetime) -> Any:
        start = period - timedelta(minutes=5)
        types = {"sum", "state", "mean"}
        return statistics.statistics_during_period(self._hass, start, None, {entity}, "5minute", None, types)

    async def energy(self, entity: str) -> Any:
        """Make an entity the grid consumption of the energy dashboard; what its own check objects to."""
        source = {
            "type": "grid", "flow_to": [], "cost_adjustment_day": 0.0,
            "flow_from": [{"stat_energy_from": entity, "stat_cost": None, "entity_energy_price": None,
                           "number_energy_price": None}],
        }  # fmt: skip
        manager = await energy.async_get_manager(self._hass)
        await manager.async_update({"energy_sources": [source]})
        return (await validate.async_validate(self._hass)).as_dict()


@contextlib.contextmanager
def answers_only() -> Iterator[Any]:
    """What Home Assistant prints goes to stderr; the stream for answers."""
    with contextlib.redirect_stdout(sys.stderr):
        yield sys.__stdout__


async def main() -> None:
    """Answer until stdin ends, then stop as Home Assistant stops."""
    logging.basicConfig(level=logging.WARNING)
    with answers_only() as out:
        hass = await start(sys.argv[1], int(sys.argv[2]))
        ask = Answers(hass)
        print(json.dumps("ready"), file=out, flush=True)
        while line := await asyncio.to_thread(sys.stdin.readline):
            command, *arguments = json.loads(line)
            answer = await getattr(ask, command)(*arguments)
            print(json.dumps(answer, default=str), file=out, flush=True)
        await hass.async_stop(force=True)


if __name__ == "__main__":
    asyncio.run(main())
