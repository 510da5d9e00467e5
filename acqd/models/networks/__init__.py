"""The thesis' networks (appendix B): structure, training, prediction."""
