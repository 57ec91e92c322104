"""Aerial control of a block: poses of an orientation as observation groups, by flight line."""
