"""The regression that hypotheses compete in: design matrix, Gram matrices, grey-box columns, onsets."""
