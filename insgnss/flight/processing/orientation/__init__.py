"""From solved segments to poses.

poses      the trajectory on the output grid, the orientation of the images, pairs of a rig
images     the images of each camera, their instants, and how their errors come from the states
strips     the covariance of all poses of a flight line, and of a whole segment
"""
