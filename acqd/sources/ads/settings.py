"""What the user says about the TwinCAT PC."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class AdsSettings:
    """One ring of one PLC runtime; docs/twincat has the PLC side."""

    host: str
    """IP address or name of the TwinCAT PC."""
    ams_net_id: str
    """Its AMS net id, "5.12.34.56.1.1"."""
    ams_port: int = 851
    """The PLC runtime."""
    local_net_id: str | None = None
    """AMS net id of this computer as the route on the TwinCAT PC names it; None: this computer's address + ".1.1"."""
    namespace: str = "GVL_Acqd"
    """Global variable list that holds stHead and aSlots."""
    poll_ms: int = 20
    """How often the ring is read [ms]."""
    f_nominal: float = 50.0
    """Declared mains frequency [Hz]."""
    vt_ratio: float = 1.0
    """Voltage transformer, primary / secondary."""
    ct_ratio: float = 1.0
    """Current transformer, primary / secondary."""
