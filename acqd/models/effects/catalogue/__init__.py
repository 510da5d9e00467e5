"""The effects, one class in each file; the file is named after the effect."""
