"""Development tools: setup and measurements."""
