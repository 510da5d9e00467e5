"""Hours of running: what acqd's processes take of a computer, and whether that grows."""
