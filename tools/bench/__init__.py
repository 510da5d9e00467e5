"""`make bench`: what acqd promises, measured on this machine, as ratios within one run where it is about speed."""
