"""Which computers, brokers, databases and disks a number of robots needs: measured figures, multiplied. Pure."""
