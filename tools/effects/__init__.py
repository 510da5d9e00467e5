"""The blind benchmark of `acqd close-loop`: cases from the virtual laboratory, verdicts, and what others say."""
