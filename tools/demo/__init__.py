"""A protocol double and the daemon together: the wire without hardware."""
