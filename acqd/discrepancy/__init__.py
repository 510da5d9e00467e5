"""What a model leaves over, which physical effect it is, and the model with that effect added."""
