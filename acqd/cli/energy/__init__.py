"""`acqd energy`: energy of a period, and of recorded motion by cause."""
