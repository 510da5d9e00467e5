"""Models beside each other on the same held-out recordings (thesis chapter 8)."""
