"""A grey box and a small network that predicts its residual."""
