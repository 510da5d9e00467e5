"""Many robots at once: which have changed, since when, why, and what they share."""
