"""A power model of physical terms: rigid body, friction, copper, supply. Every parameter has a unit."""
