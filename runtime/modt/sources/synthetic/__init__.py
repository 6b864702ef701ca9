"""A synthetic LiDAR world: the stream that is always there."""
