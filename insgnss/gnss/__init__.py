"""From RINEX of rover and base to antenna positions with an honest covariance (PPK).

It imports `base`, `geodesy`, `records`, `io` and `navigation` (whose rules decide the covariance of
a fix); `flight`, `simulation`, `batch`, `api` and `cli` import it. Ambiguities are resolved by an
existing engine, RTKLIB, in a process of its own; around it stands what it leaves open.

The way of the data, in the order that `ppk.py` holds: `rinex/` reads, `satellites/` has orbits and
geometry, `engine/` asks whether the files can give a position, runs RTKLIB forward and backward and
combines both, `phase/` has what carrier phases say beyond it (velocity, cycle slips, wet delay,
ionosphere), `exposures/` takes event times to GPST, `quality/` judges.

Where to look
    the order of it all: `ppk.py`, what phases add to its fixes: `corrections.py`; for a flight file
        `from_flight_file.py`
    options of PPK: `ppk_options.py`; the option file of RTKLIB: `options.py`
    which program RTKLIB is: `engine/program.py`; how its processes run and end: `engine/rtklib.py`
    forward and backward solutions combined: (C.1), (C.2) in `engine/combined.py`
    receivers' own logs as RINEX: `engine/convert.py`
    numbers that calibrate covariances of PPK: `covariance_model.py`; the rules that take them
        stand in `insgnss/navigation/prepare/fix_covariance/`
    a fixed solution that is not believed: `classes`, `outliers`, `confirmed` in
        `insgnss/navigation/prepare/fix_covariance/classes.py`, called by `ppk.py`
    C/N0, cycle slips, multipath: `phase/signal_quality.py` (reported, weighs nothing)
    TDCP: `phase/time_differences.py`, the velocity from it `velocity.py` there
    wet delay and ionosphere: `phase/troposphere.py`, `ionosphere.py` there with its rays in
        `ionosphere_shell.py`
    camera events by the rover's clock: `exposures/receiver_clock.py`; images without an IMU:
        `camera_positions.py` there
    what a solution says of itself: `quality/solution_quality.py`
"""
