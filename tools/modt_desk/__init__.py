"""The desk: simulation, evaluation, experiments and pictures of recorded runs; modt, the robot, never imports it."""
