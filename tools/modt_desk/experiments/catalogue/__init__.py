"""The experiments, and the statistics that they share."""
