"""The cyclic executive: MAIN_FAST in its own process, MAIN_SLOW in the daemon."""
