"""Simulated recordings of arms and meters that acqd has never met. Nothing of acqd is imported here."""
