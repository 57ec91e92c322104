"""Compiled loops over all image observations of a block. Mathematics: (J.1) to (J.7) of `adjust`.

============== ===================================================================
collinearity   residual and Jacobian of one image observation
points         all rays of one object point, linearised
elimination    normal equations without the points, and the points from their solution
posterior      cofactors of points, redundancy numbers of image observations
============== ===================================================================
"""
