"""Which effects explain the residual: ranking, acceptance, shape fit, uncertainty."""
