"""What a robot description guesses, and how much of the predicted power hangs on it."""
