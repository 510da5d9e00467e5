"""Loads that are on or off, in a residual: when, and how much."""
