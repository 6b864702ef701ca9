"""What is left of the records when the power, the disk or the process goes."""
