"""Energy, cost and CO2 of periods of local time, from the registers in SQL; pure but for `read` and `price_series`."""
