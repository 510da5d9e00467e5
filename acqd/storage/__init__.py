"""SQL: schema and migrations, the sink (MQTT -> SQL), roll-ups and retention."""
