"""Sparkplug B: the summaries as metrics of an edge node, with births, deaths and sequence numbers."""
