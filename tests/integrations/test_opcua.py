"""Rows in OPC UA, as a client of another project reads them."""

from __future__ import annotations

import asyncio
import math
import subprocess
from datetime import datetime
from unittest import mock

import pytest

pytest.importorskip("asyncua", reason="needs acqd[opcua]")

from asyncua import Client, ua
from asyncua.crypto.permission_rules import UserRole

from acqd.integrations.opcua.quality import status_of
from acqd.integrations.opcua.section import OpcUaSection
from acqd.integrations.opcua.server import OpcUaServer, _BoundedProtocol, _Readers
from acqd.telemetry.broker import free_port
from tests.integrations.messages import event, quality, status
from tests.storage.rows import row
from tests.waiting import LIMIT_S, finish, until


def take(server, sent):
    server.take(f"acqd/{sent.device}/{sent.channel}/power", sent.to_json())


@pytest.mark.parametrize(
    ("flags", "code"),
    [([], "Good"), (["late", "rms_meter"], "Good"), (["gap"], "UncertainSubNormal"),
     (["gap", "simulated"], "UncertainSimulatedValue"), (["gap", "invalid"], "BadSensorFailure")],
)  # fmt: skip
def test_quality_is_that_of_the_worst_flag(flags, code):
    assert status_of(flags).name == code


def test_a_client_reads_values_units_times_and_quality_and_may_not_write():
    async def scenario():
        section = OpcUaSection(port=free_port(), stale_s=3600)  # a busy machine may take its time
        server, stop = OpcUaServer(section), asyncio.Event()
        serving = asyncio.create_task(server.serve(stop))
        sent = row(7, P=123.5, PF=None, flags=["gap"])
        for each in (sent, row(7, device="press-1", t=1_700_000_200), row(6, P=1.0, t=1_600_000_000)):
            take(server, each)
        await until(lambda: serving.done() or not server._rows, "rows are written")
        async with Client(server.endpoint) as client:
            index = await client.get_namespace_index("urn:acqd:rows")
            root = await client.nodes.objects.get_child(f"{index}:acqd")
            assert {(await node.read_browse_name()).Name for node in await root.get_children()} == {"cell1", "press-1"}

            def node(name, device="cell1"):
                return client.get_node(ua.NodeId(f"{device}.L1.{name}", index))

            value = await node("P").read_data_value(raise_on_bad_status=False)
            assert value.Value.Value == 123.5 and value.StatusCode.name == "UncertainSubNormal"
            assert value.SourceTimestamp.replace(tzinfo=None) == datetime.fromisoformat(sent.time).replace(tzinfo=None)
            unit = await (await node("P").get_child("0:EngineeringUnits")).read_value()
            assert (unit.UnitId, unit.DisplayName.Text) == (int.from_bytes(b"WTT", "big"), "W")
            assert (await node("P").read_type_definition()).Identifier == ua.ObjectIds.AnalogUnitType
            assert (await node("PF").read_data_value(raise_on_bad_status=False)).StatusCode.name == "BadNoData"
            assert await node("flags").read_value() == ["gap"] and await node("seq").read_value() == 7
            with pytest.raises(ua.UaStatusCodeError):
                await node("P").write_value(5.0)
            section.stale_s = 0.1
            await stops(node("P", "press-1"), "BadNoCommunication")
            section.stale_s = 3600
            take(server, row(8, device="press-1", t=1_700_000_300))
            await stops(node("P", "press-1"), "Good")
            server.take(*status("press-1"))
            server.take("acqd/press-1/status", b"offline")
            await stops(node("P", "press-1"), "BadNoCommunication")
        stop.set()
        await serving

    async def stops(node, code):
        for _ in range(int(LIMIT_S / 0.01)):
            value = await node.read_data_value(raise_on_bad_status=False)
            if value.StatusCode.name == code:
                return
            await asyncio.sleep(0.01)
        raise AssertionError(f"not {code}: {value}")

    finish(scenario())


def test_a_client_reads_power_quality_and_the_newest_event_of_a_kind():
    async def scenario():
        section = OpcUaSection(port=free_port(), stale_s=3600)
        server, stop = OpcUaServer(section), asyncio.Event()
        serving = asyncio.create_task(server.serve(stop))
        for message in (
            quality(), quality(aggregation="10/12", V_thds=9.0), quality("total", V_u2=1.5, rotation="L1-L2-L3"),
            event(None), event(0.1), (quality()[0], b"{}"),
        ):  # fmt: skip
            server.take(*message)
        await until(lambda: serving.done() or not server._rows, "messages are written")
        async with Client(server.endpoint) as client:
            index = await client.get_namespace_index("urn:acqd:rows")

            async def value(name):
                node = client.get_node(ua.NodeId(f"cell1.{name}", index))
                return await node.read_data_value(raise_on_bad_status=False)

            await until_good(value, "events.dip.duration")
            distortion = await value("L1.quality.150-180.V_thds")
            assert distortion.Value.Value == 2.5 and distortion.StatusCode.name == "UncertainSimulatedValue"
            harmonics = (await value("L1.quality.150-180.V_h")).Value.Value
            assert len(harmonics) == 50 and harmonics[2] == 5.0 and math.isnan(harmonics[1])
            assert (await value("total.quality.150-180.V_u2")).Value.Value == 1.5
            assert (await value("total.quality.150-180.rotation")).Value.Value == "L1-L2-L3"
            assert (await value("L1.quality.150-180.rocof")).StatusCode.name == "BadNoData"
            assert (await value("L1.quality.10-12.V_thds")).StatusCode.name == "BadNodeIdUnknown"
            unit = client.get_node(ua.NodeId("cell1.L1.quality.150-180.V_thds.EngineeringUnits", index))
            assert (await unit.read_value()).UnitId == int.from_bytes(b"P1", "big")
            assert (await value("events.dip.extreme")).Value.Value == 161.0
            assert (await value("events.dip.phases")).Value.Value == ["L1"]
            assert (await value("events.dip.active")).Value.Value is False
        stop.set()
        await serving

    async def until_good(value, name):
        for _ in range(int(LIMIT_S / 0.01)):
            if (await value(name)).StatusCode.name == "Good":
                return
            await asyncio.sleep(0.01)
        raise AssertionError(name)

    finish(scenario())


def test_who_announces_a_chunk_of_gigabytes_is_disconnected():
    protocol = _BoundedProtocol.__new__(_BoundedProtocol)
    protocol._buffer, protocol.transport, protocol.peer_name = b"", mock.Mock(), "peer"
    for piece in (b"HELF", (2**20).to_bytes(4, "little"), b"x" * 1_000):  # the rest may come
        protocol.data_received(piece)
    assert not protocol.transport.close.called and len(protocol._buffer) == 1_008
    protocol._buffer = b"HELF"
    protocol.data_received((2**31).to_bytes(4, "little") + b"x" * 1_000)
    assert protocol.transport.close.called and len(protocol._buffer) == 4


def test_off_loopback_strangers_are_kept_out():
    with pytest.raises(ValueError, match="certificate, key, username and password are needed"):
        OpcUaSection(host="0.0.0.0")


def test_a_user_needs_the_password_and_nobody_is_an_administrator():
    open_to_all, closed = _Readers(None, None), _Readers("scada", "right")
    assert open_to_all.get_user(None, "admin").role == closed.get_user(None, "scada", "right").role == UserRole.User
    for name, password in (("scada", "wrong"), ("scada", None), (None, None), ("admin", "right")):
        assert closed.get_user(None, name, password) is None


def certificate(folder, name, uri):
    """Paths of a certificate and its key, as openssl makes them."""
    files = folder / f"{name}.pem", folder / f"{name}-key.pem"
    command = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", f"/CN={name}"]
    usage = "keyUsage=digitalSignature,nonRepudiation,keyEncipherment,dataEncipherment,keyCertSign"
    extensions = ["-addext", f"subjectAltName=URI:{uri},IP:127.0.0.1", "-addext", usage]
    subprocess.run([*command, *extensions, "-out", files[0], "-keyout", files[1]], check=True, capture_output=True)
    return files


def test_with_a_certificate_connections_are_encrypted_and_no_others_are_accepted(tmp_path):
    pem, key = certificate(tmp_path, "server", "urn:freeopcua:python:server")
    mine = certificate(tmp_path, "client", "urn:example.org:FreeOpcUa:opcua-asyncio")

    async def scenario():
        section = OpcUaSection(port=free_port(), certificate=pem, key=key, username="scada", password="right")
        server, stop = OpcUaServer(section), asyncio.Event()
        serving = asyncio.create_task(server.serve(stop))
        take(server, row(1, P=77.0))
        await until(lambda: serving.done() or not server._rows, "rows are written")
        for password in ("wrong", "right"):
            client = Client(server.endpoint)
            await client.set_security_string(f"Basic256Sha256,SignAndEncrypt,{mine[0]},{mine[1]},{pem}")
            client.set_user("scada")
            client.set_password(password)
            if password == "wrong":
                with pytest.raises(ua.UaError):
                    await client.connect()
                continue
            async with client:
                index = await client.get_namespace_index("urn:acqd:rows")
                assert await client.get_node(ua.NodeId("cell1.L1.P", index)).read_value() == 77.0
        with pytest.raises((ua.UaError, ConnectionError, TimeoutError)):
            async with Client(server.endpoint):
                pass
        stop.set()
        await serving

    finish(scenario())
