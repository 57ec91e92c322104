"""Satellites: broadcast orbits, the geometry seen by rover and base, carrier frequencies."""
