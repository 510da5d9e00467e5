"""What each extra of acqd installs: megabytes, minutes, and whether its use works without anything else."""
