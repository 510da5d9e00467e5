"""Reference server of the waveform bridge's register map (README.md)."""
