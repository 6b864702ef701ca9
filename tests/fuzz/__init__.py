"""Readers of outside bytes, fed with broken ones."""
