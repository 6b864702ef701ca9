"""Studies of accuracy and of parameters, on recorded and on simulated drives."""
