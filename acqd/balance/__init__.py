"""Energy balance of recorded motion: the predicted power by cause, the residual, and pictures of both."""
