"""The tables of a sink in a real TimescaleDB."""
