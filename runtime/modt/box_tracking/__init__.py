"""Tracking of the boxes of another detector, for `modt track`."""
