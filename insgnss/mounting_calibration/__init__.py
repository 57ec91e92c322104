"""`insgnss calibrate mounting`: lever arm, bore-sight and camera delay from one ordinary flight.

    records.py     what goes in: poses of a block, and of the flight with its whole covariance
    solution.py    the joint adjustment (L.1 to L.7)
    judgement.py   a verdict for each component, and which further flight line would determine it
    plausibility.py  poses that cannot be of this flight, and why
    run.py         flight file and poses in, mounting.toml and page out
"""
