"""Honest covariances of an engine's positions, and what a solution says of itself."""
