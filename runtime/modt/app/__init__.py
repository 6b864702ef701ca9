"""A run: its session, stages and loop, and what is known of it."""
