"""The profile of a sensor, from a recording of it."""
