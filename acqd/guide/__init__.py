"""Where the work in a folder stands, from the robot to the repaired model, and the line to type next."""
