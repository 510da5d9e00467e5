"""Models of electrical power: features, networks, grey boxes, training, bundles, comparison."""
