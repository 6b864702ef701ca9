"""Poses of the sensor: deskewing, and registration against stationary objects."""
