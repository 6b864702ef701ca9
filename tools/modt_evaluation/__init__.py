"""Evaluation of recorded runs against labels."""
