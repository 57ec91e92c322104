"""Antenna positions, one module a format."""
