"""What the loop found: report.json, report.html with figures, and the augmented bundle."""
