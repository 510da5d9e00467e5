"""Small valid inputs of each parser, from which mutations start."""
