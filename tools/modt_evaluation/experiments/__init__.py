"""The paper's experiments (its section on results) on recorded and simulated drives."""
