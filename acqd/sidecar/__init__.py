"""Beside a running cell: robot logs as they arrive, aligned with metered power, predicted, stored and published."""
