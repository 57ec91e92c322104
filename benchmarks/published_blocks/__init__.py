"""Image blocks of the literature in the sizes of their tables, with poses whose errors are drawn.

Block 2015 and corridor 2014 of paper 003 (Rehak and Skaloud 2016) and the corridor of paper 004
(Molina et al. 2017), in which a vehicle carries a target below the drone. No inertial sensor is
simulated: errors of the poses have the statistics that the papers report, and the covariance that
is written is theirs. `plans` has the numbers of the tables, `stations` and `road` fly them,
`pose_errors` draws, `points` measures in the images, `survey` puts it together (`simulate_survey`)
and `files` writes it (`write_survey`).
"""
