"""`acqd ethercat`: lists what is on an EtherCAT segment."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated

import orjson
import typer

from acqd.cli.folded_table import Table
from acqd.cli.options import Json
from acqd.cli.terminal import terminal
from acqd.errors import UserError
from acqd.sources.spec import device_module

app = typer.Typer(help="EtherCAT: EL3783 terminals behind a coupler.", no_args_is_help=True)


@app.callback()
def ethercat() -> None:
    """EtherCAT: EL3783 terminals behind a coupler."""


@app.command()
def scan(
    interface: Annotated[str, typer.Argument(help="Network interface the coupler is on.")],
    pdos: Annotated[
        bool, typer.Option("--pdos", help="Also read the PDO assignment of each EL3783 (takes them to PRE-OP).")
    ] = False,
    json: Json = False,
) -> None:
    """List the slaves on a network interface; none of their settings is changed.

    Example: acqd ethercat scan eth1
    """
    bus = device_module("ethercat.bus")
    master = bus.open_master(interface, option="INTERFACE")
    try:
        slaves = bus.scan(master)
        assigned = bus.assignments(master) if pdos else {}
    except bus.SegmentError as error:
        raise UserError(f"EtherCAT on {interface}: {error}") from None
    finally:
        bus.close_master(master)
    if json:
        report = [asdict(slave) | {"title": slave.title, "pdos": assigned.get(slave.position)} for slave in slaves]
        print(orjson.dumps(report).decode())
        return
    table = Table("position", "type", "vendor", "product", "revision", "name", title=f"slaves on {interface}")
    for slave in slaves:
        identity = (f"{number:#010x}" for number in (slave.vendor, slave.product, slave.revision))
        table.add_row(str(slave.position), slave.title, *identity, slave.name)
    console = terminal(soft_wrap=False)
    console.print(table)
    for position, lines in assigned.items():
        console.print(f"slave {position}, objects assigned to its inputs:")
        for line in lines:
            console.print(f"  {line}")
