"""Merges power rows and robot logs, whose clocks nobody synchronised, into recordings on one time vector."""
