"""Comparison of the modes of the method, and blind prediction of what they cost."""
