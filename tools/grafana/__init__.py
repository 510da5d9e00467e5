"""Makes the dashboard of config/grafana."""
