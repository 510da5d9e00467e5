"""The thesis again, step by step."""
