"""Exterior orientations independent of a program: the master eo.json, tables, relative control."""
