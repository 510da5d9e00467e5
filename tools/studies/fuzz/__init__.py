"""Fuzzing of every parser: bad input gives one line, never another exception, a hang or a flood of memory."""
