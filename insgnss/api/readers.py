"""Products of a run, read back into records."""

import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..base.errors import InputError
from ..records import Array, ExteriorOrientation, Trajectory
from ..records.interpolation import columns_at

if TYPE_CHECKING:
    from ..photogrammetry.comparison.poses import Poses


def read_eo(path: str | os.PathLike[str]) -> ExteriorOrientation:
    """Read the master exterior orientation, bit by bit as it was written.

    Parameters
    ----------
    path : eo.json, or the output directory that holds it.

    Returns
    -------
    The exterior orientation, with 6x6 covariances and those between neighbours.

    Raises
    ------
    InputError : the file is missing, is of another format, or was edited.
    """
    from ..io.formats.orientation.eo_json import read_eo_json

    file = Path(path)
    return read_eo_json(file / "eo.json" if file.is_dir() else file)


def read_poses(
    path: str | os.PathLike[str],
    form: str | None = None,
    *,
    crs: str | None = None,
    shift: tuple[float, float, float] | None = None,
    origin: tuple[float, float, float] | None = None,
    geoid: str | os.PathLike[str] | None = None,
    gps_week: int | None = None,
) -> "Poses":
    """Read poses of any program, as `compare` and the calibrations do.

    Parameters
    ----------
    path : the file or directory: Metashape, Pix4D, COLMAP, OpenSfM, MicMac, Bentley, Inpho, eo.json
        and what else `insgnss compare` reads.
    form : its format, where it does not show it.
    crs : of coordinates whose file does not name it, and in the place of a projected one.
    shift : what was subtracted from projected coordinates, in their unit.
    origin : latitude deg, longitude deg, height m of a tangent plane whose file does not say it.
    geoid : grid of geoid heights, for heights above sea level.
    gps_week : of files with the time of week only.

    Returns
    -------
    Latitudes, longitudes and heights of the images, attitudes against true north, covariances where
    the file has them.

    Raises
    ------
    InputError : the file is missing or damaged, or nobody names the frame of its coordinates.
    UsageError : the format or the CRS is unknown.
    """
    from ..photogrammetry.comparison.hints import Hints
    from ..photogrammetry.comparison.reading import read_poses as read

    grid = None if geoid is None else Path(geoid)
    return read(Path(path), form, Hints(origin, crs, gps_week, grid, shift=shift))


def read_trajectory(path: str | os.PathLike[str], gps_week: int | None = None) -> Trajectory:
    """Read a trajectory with its standard deviations.

    Parameters
    ----------
    path : trajectory.csv, an SBET (standard deviations of the smrmsg beside it), or the output
        directory that holds trajectory.csv.
    gps_week : of an SBET, which does not say it; None: 0.

    Returns
    -------
    The trajectory. The files hold standard deviations, so its covariances are diagonal, those of
    the attitude by way of roll, pitch and heading; without standard deviations they are zero.

    Raises
    ------
    InputError : the file is missing or of another format.
    """
    from ..photogrammetry.comparison.reading import sniff_poses

    file = Path(path)
    file = file / "trajectory.csv" if file.is_dir() else file
    form = sniff_poses(file)
    if form == "trajectory_csv":
        from ..io.formats.trajectory.trajectory_csv import read_trajectory_csv

        t = read_trajectory_csv(file)
        cov = _covariance(t.rpy, t.sigma)
        return Trajectory(t.time, t.lat, t.lon, t.height, t.velocity_ned, t.C_nb, cov, t.gps_week)
    if form == "sbet":
        return _read_sbet(file, gps_week)
    raise InputError.in_file(file, "is neither trajectory.csv nor SBET; give one of these")


def _read_sbet(path: Path, gps_week: int | None) -> Trajectory:
    """Return the trajectory of an SBET file, with the sigmas of the smrmsg file beside it."""
    from ..geodesy.rotation import rotation_from_rpy
    from ..io.formats.trajectory.sbet import read_sbet, read_smrmsg, smrmsg_beside

    sbet = read_sbet(path)
    sigma = np.zeros((sbet.time.size, 9))
    if (error_file := smrmsg_beside(path)) is not None:
        errors = read_smrmsg(error_file)
        table = np.column_stack([errors.sigma_position_m, errors.sigma_velocity, errors.sigma_rpy])
        sigma = columns_at(sbet.time, errors.time, table)
    return Trajectory(
        time=sbet.time,
        lat=sbet.lat,
        lon=sbet.lon,
        height=sbet.height,
        velocity_ned=sbet.velocity_ned,
        C_nb=rotation_from_rpy(sbet.rpy),
        cov=_covariance(sbet.rpy, sigma),
        gps_week=gps_week or 0,
        acceleration_b=sbet.acceleration_b,
        rate_b=sbet.rate_b,
    )


def _covariance(rpy: Array, sigma: Array) -> Array:
    """(n, 9, 9) of standard deviations of position, velocity and roll, pitch, heading."""
    from ..geodesy.rotation import rpy_jacobian

    cov = np.zeros((sigma.shape[0], 9, 9))
    diagonal = np.arange(6)
    cov[:, diagonal, diagonal] = sigma[:, :6] ** 2
    E = rpy_jacobian(rpy)
    cov[:, 6:, 6:] = np.einsum("nij,nj,nkj->nik", E, sigma[:, 6:] ** 2, E)
    return cov
