"""Motion that would have used less: counterfactuals of a program or a log, with what the model is sure of."""
