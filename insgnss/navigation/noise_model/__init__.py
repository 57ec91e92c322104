"""The noise model of an IMU: a sum of named processes for each axis, and its file."""
