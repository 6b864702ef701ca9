"""Proposals from a sweep: ground removal, Euclidean clustering, minimum boxes (section III-A)."""
