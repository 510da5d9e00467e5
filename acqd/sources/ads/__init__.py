"""A TwinCAT PC that keeps samples in a ring, read over ADS through pyads."""

from acqd.sources.ads.settings import AdsSettings
from acqd.sources.ads.source import AdsSource

__all__ = ["AdsSettings", "AdsSource"]
