"""Tracking of classified boxes of another detector, for `modt track`."""
