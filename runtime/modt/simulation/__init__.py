"""The synthetic LiDAR world."""
