"""Energy meters: what a machine can say about the power it draws."""
