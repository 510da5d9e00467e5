"""Alarms of sidecars and states of daemons, by webhook and e-mail, until somebody acknowledges them."""
