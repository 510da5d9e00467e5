"""Home Assistant: entities that it discovers by retained messages."""
