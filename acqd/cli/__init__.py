"""The `acqd` command: argument handling and printing, nothing else."""
