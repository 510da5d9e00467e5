"""What the user says about a merging unit."""

from __future__ import annotations

from dataclasses import dataclass

U_V_PER_DIGIT = 0.01
"""IEC 61850-9-2LE, IEC 61869-9: 10 mV."""
I_A_PER_DIGIT = 0.001
"""IEC 61850-9-2LE, IEC 61869-9: 1 mA."""
NINE_TWO_LE_CHANNELS = (4, 0, 5, 1, 6, 2)
"""Positions of U1, I1, U2, I2, U3, I3 in the 9-2LE data set Ia Ib Ic In Ua Ub Uc Un."""


@dataclass(frozen=True, slots=True)
class SampledValuesSettings:
    """One stream of one merging unit."""

    interface: str
    """Network interface, "eth1"."""
    svid: str | None = None
    """svID of the stream; None: the only one on the wire."""
    appid: int | None = None
    """APPID of the stream; None: any."""
    rate: float | None = None
    """Samples/s; None: as the frames say, or as counted over one wrap of smpCnt."""
    channels: tuple[int, ...] = NINE_TWO_LE_CHANNELS
    """Positions of U1, I1, U2, I2, ... among the values of the data set."""
    u_scale: float = U_V_PER_DIGIT
    """V per digit."""
    i_scale: float = I_A_PER_DIGIT
    """A per digit."""
    vt_ratio: float = 1.0
    """Voltage transformer, primary / secondary, of a merging unit that publishes secondary values."""
    ct_ratio: float = 1.0
    """Current transformer, likewise."""
    f_nominal: float = 50.0
    """Declared mains frequency [Hz]."""

    @property
    def scale(self) -> tuple[float, ...]:
        """Primary V or A per digit and channel."""
        pair = (self.u_scale * self.vt_ratio, self.i_scale * self.ct_ratio)
        return pair * (len(self.channels) // 2)
