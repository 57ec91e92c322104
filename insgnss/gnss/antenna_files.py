"""The antenna positions of the published tree: AntennaPos_WGS84.txt, AntennaPos_Img_WGS84.txt,
AntennaPos_Img_WGS84_tangentplane.txt.

Positions at exposures are interpolated between fixes by the cubic through the two before and the
two after, of uneven intervals h, in a Cartesian frame: its error is (3/128) h^4 of the fourth
derivative, 10 micrometres at 10 Hz in a turn of 10 m/s and 15 m radius, and centimetres at 1 Hz. An
exposure that has no fix within `LONGEST_GAP_S` on either side gets no position here: it is named in
a check. All are positions of the antenna's phase centre, not of the camera. Formats:
data_specs/gnss_text.md.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..base.errors import DataError
from ..base.wording import some
from ..geodesy.frames import LocalFrame, TangentPlane
from ..io.formats.gnss.gnss_text import ImagePositions, write_gnss_text, write_image_positions
from ..records import Array, CameraEvents, Finding, GnssFixes, Question

SOLUTION_FILE = "ppk.pos"
ALL = "AntennaPos_WGS84.txt"
IMAGES_FILE = "AntennaPos_Img_WGS84.txt"
PLANE = "AntennaPos_Img_WGS84_tangentplane.txt"
ANTENNA_FILES: tuple[str, ...] = (ALL, IMAGES_FILE, PLANE)
LONGEST_GAP_S = 1.5  # s, between neighbouring fixes, for an exposure between them
LONGEST_INTERVALS = 2.5  # the same in intervals of the fixes, where they are rarer
CUBIC_FIXES = 4  # fixes that a cubic needs
NAMED_IMAGES = 5  # images that a finding names: 5, because a line holds no more


def positions_of_others(directory: Path) -> str | None:
    """Return the name of a file of antenna positions that must not be overwritten.

    It lies in a directory without a solution of ours (`SOLUTION_FILE`); None where there is none.
    """
    present = next(
        (name for name in (SOLUTION_FILE, *ANTENNA_FILES) if (directory / name).exists()), None
    )
    return None if (directory / SOLUTION_FILE).is_file() else present


def write_antenna_files(
    fixes: GnssFixes, events: CameraEvents | None, directory: Path, origin: Array | None = None
) -> tuple[tuple[Path, ...], Finding | None]:
    """Write the positions of all fixes, and of the images where there are events.

    Parameters
    ----------
    fixes : GnssFixes
        Antenna positions.
    events : CameraEvents, optional
        Exposures with the names of their images.
    directory : Path
        Gets the files.
    origin : ndarray, shape (3,), optional
        Latitude rad, longitude rad, ellipsoidal height m of the tangent plane; by default the first
        fix, at height 0.

    Returns
    -------
    paths : tuple of Path
        The files that were written.
    check : Finding or None
        Names the images without position.

    Raises
    ------
    DataError
        Where no exposure lies between fixes.
    """
    write_gnss_text(fixes, directory / ALL)
    if events is None:
        return (directory / ALL,), None
    positions, covered = positions_at(fixes, events.time)
    if not covered.any():
        raise DataError(
            f"{events.source or 'events'}: none of the {covered.size} exposures"
            f" ({events.time[0]:.3f}"
            f" to {events.time[-1]:.3f} s) lies between fixes ({fixes.time[0]:.3f} to"
            f" {fixes.time[-1]:.3f} s); are both of one flight and in GPST?"
        )
    names = tuple(
        name
        for name, has_position in zip(events.images, covered.tolist(), strict=True)
        if has_position
    )
    lat0, lon0, h0 = (fixes.lat[0], fixes.lon[0], 0.0) if origin is None else origin
    plane = TangentPlane(float(lat0), float(lon0), float(h0)).position_from_geodetic(
        *positions[covered].T
    )
    write_image_positions(
        ImagePositions(names, positions[covered], "geodetic"), directory / IMAGES_FILE
    )
    write_image_positions(ImagePositions(names, plane, "tangent_plane"), directory / PLANE)
    return tuple(directory / name for name in (ALL, IMAGES_FILE, PLANE)), _check_covered(
        events, covered
    )


def positions_at(fixes: GnssFixes, time: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Interpolate antenna positions by the cubic through the four fixes around.

    Parameters
    ----------
    fixes : GnssFixes
        Antenna positions.
    time : ndarray, shape (m,)
        s, of the fixes' week.

    Returns
    -------
    positions : ndarray, shape (m, 3)
        Latitude rad, longitude rad, height m; NaN where fixes are missing.
    covered : ndarray of bool, shape (m,)
        Where they are not.
    """
    out = np.full((time.size, 3), np.nan)
    if fixes.time.size < CUBIC_FIXES:
        return out, np.zeros(time.size, dtype=np.bool_)
    longest = max(LONGEST_GAP_S, LONGEST_INTERVALS * float(np.median(np.diff(fixes.time))))
    later_fix = np.clip(np.searchsorted(fixes.time, time), 1, fixes.time.size - 1)
    inside = (time >= fixes.time[0]) & (time <= fixes.time[-1])
    covered = inside & (fixes.time[later_fix] - fixes.time[later_fix - 1] <= longest)
    frame = LocalFrame(float(fixes.lat[0]), float(fixes.lon[0]), float(fixes.height[0]))
    position = frame.position_from_geodetic(fixes.lat, fixes.lon, fixes.height)
    first_node = np.clip(later_fix[covered] - 2, 0, fixes.time.size - CUBIC_FIXES)
    rows = first_node[:, None] + np.arange(CUBIC_FIXES)
    interpolated = cubic(fixes.time[rows], position[rows], time[covered])
    # a gap next to the interval: the cubic would overshoot
    linear = fixes.time[first_node + CUBIC_FIXES - 1] - fixes.time[first_node] > 3.0 * longest
    interpolated[linear] = _linear(
        fixes.time, position, time[covered][linear], later_fix[covered][linear]
    )
    out[covered] = np.stack(frame.geodetic_from_position(interpolated), axis=-1)
    return out, covered


def cubic(node: Array, value: Array, time: Array) -> Array:
    """Interpolate by Lagrange's cubics.

    Parameters
    ----------
    node : ndarray, shape (m, 4)
        Times, s.
    value : ndarray, shape (m, 4, 3)
        Values there.
    time : ndarray, shape (m,)
        s.

    Returns
    -------
    ndarray, shape (m, 3)
        Values at `time`.
    """
    out = np.zeros((time.size, 3))
    for k in range(CUBIC_FIXES):
        neighbours = [j for j in range(CUBIC_FIXES) if j != k]
        weight = np.prod(
            (time[:, None] - node[:, neighbours]) / (node[:, k, None] - node[:, neighbours]), axis=1
        )
        out += weight[:, None] * value[:, k]
    return out


def _linear(node: Array, value: Array, time: Array, later: NDArray[np.int64]) -> Array:
    """Interpolate values (n, 3) at nodes (n,), s, to `time` (m,), each before node `later` (m,)."""
    share = (time - node[later - 1]) / (node[later] - node[later - 1])
    return np.asarray(value[later - 1] + share[:, None] * (value[later] - value[later - 1]))


def _check_covered(events: CameraEvents, covered: NDArray[np.bool_]) -> Finding | None:
    """Return a note that names the images outside `covered` (n,), None where there are none."""
    if covered.all():
        return None
    missing = [
        name
        for name, has_position in zip(events.images, covered.tolist(), strict=True)
        if not has_position
    ]
    finding = f"{len(missing)} of {covered.size} images have no fixes around them:"
    finding += f" {some(missing, NAMED_IMAGES)}"
    return Question("images without position", "fixes around every exposure").note(
        finding, "process the flight with its IMU, which bridges such gaps"
    )
