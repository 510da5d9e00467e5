"""Faults on real processes, and what became of every row."""
