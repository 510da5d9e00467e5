"""Power quality: harmonics, aggregation, events, flicker. Pure numerics, like all of metering."""
