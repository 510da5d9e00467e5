"""Sequential test on a residual that grows, and the watch on a growing dataset."""
