"""`make bench`: measures on this machine what acqd promises. Speeds are compared as ratios within one run."""
