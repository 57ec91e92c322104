"""Noise from the innovations of a flight."""
