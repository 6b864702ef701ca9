"""modt: finds and follows what moves around a robot, on one core, and says what that cost.

This module stays free of heavy imports: the command line pins the process to its core before NumPy loads.
"""

__version__ = "0.1.0"
