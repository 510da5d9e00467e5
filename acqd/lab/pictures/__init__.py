"""Pictures of what the laboratory does, after the thesis' Figures 5.1 to 5.4, and its HTML reports."""
