"""Lags of simulated campaigns whose clocks and supplies are known."""
