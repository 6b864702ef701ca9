"""Simulator of a LiDAR in synthetic scenes."""
