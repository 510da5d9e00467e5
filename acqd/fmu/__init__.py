"""A bundle as an FMU: self-contained C, FMI 2.0 and 3.0 for co-simulation, no Python and no runtime in the target."""
