"""Commands on recordings, profiles and energy: argument parsing alone."""
