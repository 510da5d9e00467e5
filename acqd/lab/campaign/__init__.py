"""Campaigns: many sessions with robot logs, rows in SQL, a public manifest and a separate truth record."""
