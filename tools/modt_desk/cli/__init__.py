"""Commands of the desk: argument parsing alone."""
