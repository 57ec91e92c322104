"""Kinematic ground control: a vehicle whose target the images see, from its files to groups.

=============== ====================================================================================
observed        which image observations are the vehicle's; one point an image
track           where the vehicle was: trajectory.csv, eo.json, a table of positions; between its
                rows; errors that last
places          the target at the exposures, with one covariance; stamps that cannot be
rays            is the vehicle where the images see it: clock, base, lever arm before an adjustment
control         observation groups, their parameters, first values
verdict         what the adjustment says of the vehicle: figures and findings
=============== ====================================================================================
"""
