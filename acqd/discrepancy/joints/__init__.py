"""Logged joint torques or motor currents as a second witness beside the power."""
