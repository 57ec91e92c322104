"""Verbs of many flights: `batch` and `archive`."""
