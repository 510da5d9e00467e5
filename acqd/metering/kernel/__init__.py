"""The arithmetic of a window in C."""

from acqd.metering.kernel.kernel import Kernel, why_not

__all__ = ["Kernel", "why_not"]
