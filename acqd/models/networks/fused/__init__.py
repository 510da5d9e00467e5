"""LSTM(10) with a folded head in one C function, forward and backward, compiled where it runs."""
