"""Sequences of frames that no recording has, and what a pipeline promises whatever it is fed with."""
