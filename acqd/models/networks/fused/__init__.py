"""LSTM(10) with a folded head, forward and backward in one C function that is compiled at first use."""
