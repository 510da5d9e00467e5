"""The archive of the daemon: written while it runs, and metered again."""
