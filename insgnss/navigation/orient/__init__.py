"""Trajectory and covariance to every exposure, through lever arms, bore-sight and camera mount."""
