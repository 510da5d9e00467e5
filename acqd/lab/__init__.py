"""The virtual laboratory: trajectories, a robot controller, a plant on simulated mains, campaigns.

All its output is flagged `simulated`. No model and no analysis may import it: its equations are the truth that they
have to find.
"""
