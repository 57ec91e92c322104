"""What stands behind `insgnss calibrate tripod | similarity | materialise | mounting`: files in, a
verdict on each component of the mounting, `mounting.toml` and a page out.

The formulas of the first three stand in `insgnss.photogrammetry.lever_arm`; here files are read and
joined by names (`poses`), what does not belong together is named (`readings`), and results become
products (`products`). `calibrate mounting` has its adjustment here, since it processes the flight:

    intersections           targets and ground points from the images that see them
    records, block_poses    poses of a block, and of the flight with its whole covariance
    equations               its unknowns and observation equations (L.1, L.2, L.5, L.6)
    solution                the joint adjustment (L.4), its factors, what one more line would give
    block_errors            what errors of a block's poses look like
    judgement               a verdict each, and which further flight line would determine it
    plausibility            poses that are not of this flight, and why
    in_flight               flight file and poses in, mounting out, which was tried
    flight_products         the same for file, page and terminal
"""
