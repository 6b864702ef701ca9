"""Proposals from a sweep: ground removal, Euclidean clustering and boxes (section III-A)."""
