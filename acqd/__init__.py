"""acqd: an energy twin's measurement chain, from 20 kHz samples to explained power."""

__version__ = "0.1.0"
