"""The service on the measurement PC: its configuration, and the tasks that make up `acqd run`."""
