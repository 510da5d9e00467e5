"""The conformance sheet: test points of the standards, metered by simulation through the chain from codes to SQL."""
