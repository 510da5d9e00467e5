"""The model with the selected effects: terms, joint re-fit, and the guard on held-out recordings."""
