"""The sensor, recognised from its first sweep."""
