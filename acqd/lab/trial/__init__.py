"""A trial of the whole chain: a change that a seed draws, and what the loop says compared with the truth."""
