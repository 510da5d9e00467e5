"""Double of a TwinCAT PC: AMS/TCP server with the ring of `docs/twincat`, for pyads and for raw sockets."""

from tests.doubles.ads.control import AdsProcess, unused_host
from tests.doubles.ads.double import AdsDouble, Settings

__all__ = ["AdsDouble", "AdsProcess", "Settings", "unused_host"]
