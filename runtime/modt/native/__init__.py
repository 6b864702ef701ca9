"""Passes of segmentation in C99: sources, their compilation, and the library in a process."""
