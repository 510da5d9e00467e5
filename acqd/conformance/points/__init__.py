"""The test points, by parameter: functions that feed an instrument and yield judged points."""
