"""Comparison of models on the same held-out recordings (thesis chapter 8)."""
