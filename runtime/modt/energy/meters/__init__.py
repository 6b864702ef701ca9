"""Energy meters: power and energy readings of a machine."""
