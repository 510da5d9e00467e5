"""Reading all registers of one meter, as coarsely as it permits."""

from __future__ import annotations

from dataclasses import replace

from acqd.sources.meters.plan import GAP, make_plan
from acqd.sources.meters.profile import Profile, Register
from acqd.sources.modbus.client import ILLEGAL_ADDRESS, ModbusClient, ModbusError


class MeterAccess:
    """One unit and its profile; learns from the meter's refusals.

    Some meters refuse reads that span registers between their quantities: then each group is read
    on its own. Some lack registers of the profile (older firmware): those quantities are left out.
    """

    def __init__(self, unit: int, profile: Profile) -> None:
        self.unit = unit
        self.profile = profile
        """What is left of the profile."""
        self.plan = make_plan(profile)
        self._gap = GAP

    def read(self, client: ModbusClient) -> list[bytes]:
        """The answers to the plan's reads. Raises ModbusError."""
        try:
            return client.read(self.unit, list(self.plan.reads), self.profile.pause_s)
        except ModbusError as error:
            if error.code != ILLEGAL_ADDRESS:
                raise
        if self._gap:
            self._gap = 0
            self.plan = make_plan(self.profile, gap=0)
        else:
            self._leave_out(client)
        return self.read(client)

    def _leave_out(self, client: ModbusClient) -> None:
        """Drop quantities whose registers the meter refuses. Raises ModbusError when it refuses voltages or powers."""
        kept: dict[str, Register] = {}
        refusals: list[ModbusError] = []
        for name, register in self.profile.quantities.items():
            try:
                client.read(self.unit, [(register.function, register.address, register.width)], self.profile.pause_s)
                kept[name] = register
            except ModbusError as error:
                if error.code != ILLEGAL_ADDRESS:
                    raise
                refusals.append(error)
        essential = {f"L{k + 1}.Vrms" for k in range(self.profile.phases)}
        if refusals and (not essential <= set(kept) or not any(name.endswith(".P") for name in kept)):
            raise ModbusError(f"{refusals[0]}; is it this model?", None)
        if not refusals:
            raise ModbusError(f"unit {self.unit} refuses reads that it allowed a moment ago", None)
        self.profile = replace(self.profile, quantities=kept)
        self.plan = make_plan(self.profile, gap=0)
