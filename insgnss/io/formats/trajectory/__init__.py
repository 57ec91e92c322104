"""Trajectories, one module a format."""
