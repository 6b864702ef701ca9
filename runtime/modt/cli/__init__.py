"""The command line `modt`, and its commands on a robot."""
