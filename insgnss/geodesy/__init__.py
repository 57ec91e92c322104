"""Pure formulas: rotations, the ellipsoid and its gravity, frames, projections, and time.

It imports `base`, and every wing above imports it. No function here reads a file of a flight or
keeps anything; what the letters of frames and rotations mean stands in `insgnss/__init__.py`.

The way of the data: numbers in, numbers out. Geodetic coordinates become ECEF and local Cartesian
ones (`frames.py`); coordinates of a projected CRS and heights above a geoid go through PROJ
(`projection.py`, `crs.py`, `datums.py`) with its grids (`grids.py`); dates and UTC become seconds
of a GPS week (`gpstime.py`).

Where to look
    SO(3), quaternions and the sets of angles of the field: `rotation.py`
    WGS84 and normal gravity: `earth.py`; compiled for loops over samples: `_kernels.py`
    local frames, and `C_mn`, which takes the attitude to the tangent plane: `frames.py` (used in
        (O.1) of `insgnss/navigation/orient/exterior.py`)
    the datum of the positions: `crs.py` (`source_crs`); a CRS refused for a missing grid:
        `projection.py` (`_refuse_missing_grid`), before a flight is solved by
        `insgnss/flight/processing/checks.py`; options `gnss.datum`, `gnss.epoch`
    meridian convergence and the scale of a projection: `projection.py`
    the axes of an IMU in words (forward right down): `axes.py`
    leap seconds and weeks: `gpstime.py`
    the similarity of two frames in closed form, as calibrations of lever arms need it:
        `similarity.py`
    least squares of calibrations, groups with covariances, variance factors and further
        observations: `least_squares.py`
    in which conventions files of the same data differ: `conventions.py`; which of them explains a
        misfit, with the one pair of limits for all wings: `explain.py`; how a file of positions or
        attitudes may have been written: `readings.py`
    the height that belongs to an air pressure: `atmosphere.py`
"""
