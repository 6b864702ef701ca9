"""Sensors that are read as they measure."""
