"""A run: its inputs, its stages, its loop, and its status."""
