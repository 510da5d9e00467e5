"""The residual, measured minus predicted power: noise model, figures of merit, clock delay."""
