"""What may be the cause: calibrated probabilities, and a set that holds the cause in 95 % of cases (ADR 65)."""
