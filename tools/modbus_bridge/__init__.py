"""Reference server of the waveform bridge's register map (docs/modbus-bridge/README.md)."""
