"""HTML reports of the laboratory and their figures."""
