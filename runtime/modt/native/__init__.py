"""Passes of segmentation, geometry and tracking in C99: their sources, their compilation, and their use."""
