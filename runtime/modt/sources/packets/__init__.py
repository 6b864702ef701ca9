"""Sensors' packets, from the network or a capture, to sweeps."""
