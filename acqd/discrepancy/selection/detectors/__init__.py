"""Candidates whose columns come from the residual itself: ripple, switching loads, contact."""
