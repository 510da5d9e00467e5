"""A grey box, and a small network for what it leaves over."""
