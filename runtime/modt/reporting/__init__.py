"""Summaries, energy reports and comparisons, as text, JSON and HTML pages."""
