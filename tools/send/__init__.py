"""Senders of recorded and simulated sensors, at their pace."""
