"""The example flow in a real Node-RED: npm install --prefix DIR node-red, then ACQD_NODE_RED=DIR."""

from __future__ import annotations

import asyncio
import json
import os
import subprocess
from pathlib import Path

import aiomqtt
import pytest

from acqd.telemetry.broker import free_port
from tests.integrations.messages import summary
from tests.places import ROOT
from tests.waiting import finish, until

FLOW = ROOT / "config" / "node-red" / "flow.json"
PROGRAM = Path(os.environ.get("ACQD_NODE_RED", "/nowhere")) / "node_modules" / "node-red" / "red.js"


def test_nodes_of_the_flow_are_wired_to_nodes_of_the_flow():
    nodes = {node["id"]: node for node in json.loads(FLOW.read_text())}
    for node in nodes.values():
        for target in (name for output in node.get("wires", []) for name in output):
            assert target in nodes
        assert node.get("broker", "acqd-broker") in {"acqd-broker", "127.0.0.1"}


@pytest.mark.skipif(not PROGRAM.exists(), reason="needs Node-RED: npm install --prefix DIR node-red, ACQD_NODE_RED=DIR")
def test_node_red_computes_the_energy_of_the_day(mosquitto, tmp_path):
    flow = FLOW.read_text().replace('"1883"', f'"{mosquitto.port}"')
    (tmp_path / "flow.json").write_text(flow)
    settings = (
        f"module.exports = {{uiHost: '127.0.0.1', uiPort: {free_port()}, flowFile: 'flow.json', telemetry: {{}}}}"
    )
    (tmp_path / "settings.js").write_text(settings)
    command = ["node", PROGRAM, "--userDir", tmp_path, "--settings", tmp_path / "settings.js"]
    log = (tmp_path / "log").open("w")
    with subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT) as running:
        try:
            finish(scenario(mosquitto.port))
        finally:
            running.terminate()
            log.close()


async def scenario(port):
    found = {}

    async def listen(client):
        async for message in client.messages:
            found[str(message.topic)] = json.loads(message.payload)

    async with aiomqtt.Client("127.0.0.1", port) as client:
        await client.subscribe("plant/#", qos=1)
        listening = asyncio.create_task(listen(client))
        topic, payload = summary("cell", W_import=5.0, P=10.0)
        await client.publish(topic, payload, 1, retain=True)
        await until(lambda: found.get("plant/cell/energy_today", {}).get("kWh") == 0, "Node-RED answers")
        assert "plant/cell/high_power" not in found
        await client.publish(*summary("cell", W_import=5.25, P=4000.0), qos=1)
        await until(lambda: "plant/cell/high_power" in found, "Node-RED warns")
        assert found["plant/cell/energy_today"]["kWh"] == pytest.approx(0.25)
        assert found["plant/cell/high_power"]["P"] == 4000.0
        await client.publish(*summary("cell", W_import=1.0, time="2026-11-24T00:00:01Z"), qos=1)
        await until(lambda: found["plant/cell/energy_today"]["since"] == "2026-11-24", "the next day begins")
        assert found["plant/cell/energy_today"]["kWh"] == 0
        listening.cancel()
