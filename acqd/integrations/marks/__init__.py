"""What devices work on, as a production system publishes it over MQTT: kept as the marks of `acqd energy --by part`."""
