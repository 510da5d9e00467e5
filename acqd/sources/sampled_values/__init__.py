"""Sampled values of a merging unit: IEC 61850-9-2LE and IEC 61869-9 over Ethernet."""

from acqd.sources.sampled_values.settings import SampledValuesSettings
from acqd.sources.sampled_values.source import SampledValuesSource

__all__ = ["SampledValuesSettings", "SampledValuesSource"]
