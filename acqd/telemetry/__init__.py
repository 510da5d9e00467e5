"""Rows on the wire: schema, topics, MQTT_CONNECTOR, embedded broker."""
