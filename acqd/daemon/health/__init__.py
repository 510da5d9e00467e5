"""How daemon and sink are: counters, verdict, HTTP endpoints on a loopback port, watchdog."""
