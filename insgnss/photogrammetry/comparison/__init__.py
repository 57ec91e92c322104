"""Two exterior orientations or trajectories, of whatever format, held against each other.

The comparison states differences, and what would explain them.

`compare.compare_files` reads both, brings them to one frame and one clock, matches them by image
name or by time, and tests what usually goes wrong between two programs: swapped angles, turned
axes, 18 seconds, a geoid.
"""
