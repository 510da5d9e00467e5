"""From two unsynchronised recordings to one: power rows and robot logs on a common time vector."""
