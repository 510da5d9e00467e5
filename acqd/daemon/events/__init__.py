"""Voltage events of a running daemon: detection, messages, kept waveforms."""
