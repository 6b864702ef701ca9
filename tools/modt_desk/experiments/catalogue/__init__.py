"""The experiments, one file each, and the statistics that they share."""
