"""Profiles of sensors and boards, and the energy of runs: fits, predictions, comparisons and reports."""
