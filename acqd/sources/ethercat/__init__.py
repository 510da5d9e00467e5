"""EL3783 terminals behind an EtherCAT coupler, through pysoem."""

from acqd.sources.ethercat.settings import EthercatSettings
from acqd.sources.ethercat.source import EthercatSource

__all__ = ["EthercatSettings", "EthercatSource"]
