"""Calibrates the probabilities of causes, and measures how often their sets hold the cause."""
