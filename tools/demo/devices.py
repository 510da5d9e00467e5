"""The doubles of the demonstrations. Each one yields the `[source]` section that reaches it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager

from tests.doubles.ads import AdsProcess, unused_host
from tests.doubles.ethercat.control import EtherCatDouble
from tests.doubles.modbus import ModbusProcess
from tests.doubles.sampled_values import MergingUnitProcess
from tests.doubles.veth import veth_pair


@contextmanager
def ethercat() -> Iterator[str]:
    """An EK1100 with one EL3783."""
    with veth_pair("acqdemo") as (near, far), EtherCatDouble(far, clock="real"):
        yield f'kind = "ethercat"\ninterface = "{near}"\n'


@contextmanager
def ads() -> Iterator[str]:
    """A TwinCAT PC."""
    with AdsProcess(unused_host(), clock="real") as double:
        yield f'kind = "ads"\nhost = "{double.host}"\nams_net_id = "{double.net_id}"\n'


@contextmanager
def modbus() -> Iterator[str]:
    """A waveform bridge with three phases."""
    with ModbusProcess("bridge") as double:
        yield f'kind = "modbus"\nhost = "127.0.0.1"\nport = {double.port}\n'


@contextmanager
def sampled_values() -> Iterator[str]:
    """A merging unit of a medium-voltage grid: 10 kV and 40 A."""
    with veth_pair("acqdemo") as (near, far), MergingUnitProcess(far, rate=4800, asdus=2, autostart=True):
        yield f'kind = "sampled-values"\ninterface = "{near}"\nsvid = "MU0101"\nrate = 4800\n'


@contextmanager
def meters() -> Iterator[str]:
    """Three RMS meters on one RS-485 line at 19200 Bd."""
    with ModbusProcess("meters", "--model", "em340", "--units", "1-3", "--rtu", "--baudrate", "19200") as double:
        section = f'kind = "meters"\nserial_port = "{double.path}"\nbaudrate = 19200\n'
        for unit in (1, 2, 3):
            section += f'[[source.meters]]\nname = "meter-{unit}"\nprofile = "em340"\nunit = {unit}\n'
        yield section


DEVICES: dict[str, Callable[[], AbstractContextManager[str]]] = {
    "ethercat": ethercat,
    "ads": ads,
    "modbus": modbus,
    "sv": sampled_values,
    "meters": meters,
}
ON_ETHERNET = ("ethercat", "sv")
"""These need a veth pair."""
