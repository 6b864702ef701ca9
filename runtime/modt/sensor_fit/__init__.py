"""Recognition of the sensor by its first sweep."""
