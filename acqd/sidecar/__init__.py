"""The sidecar of a running cell: aligns arriving robot logs with metered power, predicts, stores, publishes."""
