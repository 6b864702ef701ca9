"""The profile of a sensor, fitted to a recording of it."""
