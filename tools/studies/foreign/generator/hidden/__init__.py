"""Hidden effects: those that acqd's library has a name for, and those outside of it."""
