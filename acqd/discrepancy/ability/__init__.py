"""What the recordings could tell: the smallest size of every effect, and which effects they tell apart."""
