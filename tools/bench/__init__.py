"""CPU time of the stages."""
