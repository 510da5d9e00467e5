"""Campaigns: many sessions with logs, rows in SQL, manifest and truth."""
