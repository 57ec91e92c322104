"""Logs of autopilots: IMU, GNSS and camera messages in one file."""
