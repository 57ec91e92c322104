"""From solved segments to poses.

poses      the trajectory on the output grid, and the orientation of the images
images     the images of each camera, their instants, and how their errors come from the states
rig_pairs  the covariance of any two images of a rig
strips     the covariance of all poses of a flight line, and of a whole segment
"""
