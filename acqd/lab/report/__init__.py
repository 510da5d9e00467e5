"""HTML reports of the laboratory, with their figures."""
