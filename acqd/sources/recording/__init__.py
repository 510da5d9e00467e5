"""Recordings of any format as channels: what each one is, which are metered, and the waveform they make."""
