"""A protocol double and the daemon together: the wire at work without hardware."""
