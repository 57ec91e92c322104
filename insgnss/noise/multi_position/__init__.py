"""The deterministic calibration of an IMU from static positions."""
