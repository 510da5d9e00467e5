"""The measurement PC's service: configuration, and the tasks of one `acqd run` put together."""
