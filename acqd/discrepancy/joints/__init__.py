"""Logged joint torques or motor currents as a second witness besides the power."""
