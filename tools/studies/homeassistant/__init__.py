"""acqd's discovery messages in Home Assistant itself."""
