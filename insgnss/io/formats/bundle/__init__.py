"""Exterior orientations for programs of bundle adjustment, one module a program."""
