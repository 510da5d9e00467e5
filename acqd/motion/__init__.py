"""Motion of a robot: trajectories, programs, path planning, time profiles, the controller that executes them."""
