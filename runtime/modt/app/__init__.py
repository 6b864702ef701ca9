"""A run: its session, its stages, and its status."""
