"""Sinks: formats and files of results."""
