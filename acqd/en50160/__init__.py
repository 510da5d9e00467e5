"""The week of EN 50160: statistics of a supply voltage from stored rows of power quality, and their report."""
