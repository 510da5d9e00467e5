"""`acqd fleet` on virtual robots, some with hidden effects, most of these of one cause (simulated)."""
