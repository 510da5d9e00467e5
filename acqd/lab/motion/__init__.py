"""Motion of the virtual robot: trajectories, programs, path planning, controller."""
