"""The camera at the exposures by PPK alone, without IMU.

Positions are interpolated as `antenna_files.positions_at` does it, and moved by the offset from the
antenna to the camera where the drone states it (.MRK). Their covariance has three parts:

    P = (1 - s) P_0 + s P_1 + e^2 (4 s (1 - s))^2 (h / H)^3 I + v v^T sigma_t^2                (C.1)

s being the share of the interval h between the fixes 0 and 1 around that has passed. Errors of
neighbouring fixes are alike, so that no mean makes them smaller. e is what the fixes themselves
show of the interpolation: each of them is predicted by the cubic through the two before and the two
after it, over an interval of 2 H, H being the usual one; white accelerations, which the smooth part
of a flight stays below, leave sqrt(1 / 8) of the rms of the difference in the middle of an interval
of H; the cubic's slope at a fix is not the path's, so that it falls off as s does. Of that the
differences of the nine fixes around count. What is noise of the fixes in them counts as motion: e
is rather too large. sigma_t is the standard deviation of the exposure's time where the events have
one, v the velocity.

The offset is taken as exact: its errors are those of the drone's attitude, 1 deg of which are 3 mm
of 0.2 m.
"""

from pathlib import Path

import numpy as np

from ...base.errors import DataError
from ...geodesy.frames import geodetic_to_ecef, moved_geodetic, rotation_en
from ...geodesy.gpstime import WEEK_S
from ...io.exposures.match import delay_events
from ...io.exposures.naming import ImageMatch, events_of, named
from ...io.formats import read_gnss
from ...records import Array, CameraEvents, Finding, GnssFixes, Question
from ...records.cameras.camera_positions import CameraPositions
from ...records.qualities import Quality
from ..antenna_files import cubic, positions_at

NEIGHBOURS = 4  # fixes to either side whose differences tell how well others interpolate
# rms error in the middle of an interval over that of the cubic across two: white accelerations
TO_MIDDLE = 8.0**-0.5
WIDTH_EXPONENT = 1.5  # of an interval's width over the usual one: (C.1) of white accelerations
LEAST_FIXES = 5  # a cubic through two on either side of the fix that it predicts
LARGE_M = 0.05  # beyond it the interpolation is what limits a position: a note


def camera_positions(
    fixes: GnssFixes, events: CameraEvents
) -> tuple[CameraPositions, tuple[Finding, ...]]:
    """Return the camera's, or else the antenna's, positions at the exposures between fixes.

    Parameters
    ----------
    fixes : GnssFixes
        Antenna positions with covariances.
    events : CameraEvents
        Exposures, GPST; with offsets from antenna to camera, or without.

    Returns
    -------
    positions : CameraPositions
        Of the exposures that have fixes around them.
    checks : tuple of Finding
        What the positions are of, and how well they are interpolated.

    Raises
    ------
    DataError
        Where no exposure lies between fixes.
    """
    weeks_s = 0.0
    if fixes.gps_week is not None and events.gps_week is not None:
        weeks_s = (events.gps_week - fixes.gps_week) * WEEK_S
    geodetic, covered = positions_at(fixes, events.time + weeks_s)
    if not covered.any():
        raise DataError(
            f"{events.source or 'events'}: none of the {covered.size} exposures lies between fixes"
            f" ({fixes.time[0]:.3f} to {fixes.time[-1]:.3f} s); are both of one flight and in GPST?"
        )
    events = events[covered]
    time = events.time + weeks_s
    cov, interpolation_sd = _covariance(fixes, time, events.sigma_s)
    quality = np.full(time.size, float(Quality.UNKNOWN))
    if fixes.quality is not None:
        later = np.clip(np.searchsorted(fixes.time, time), 1, fixes.time.size - 1)
        quality = np.maximum(fixes.quality[later - 1], fixes.quality[later]).astype(np.float64)
    lat, lon, height = geodetic[covered].T
    if events.offset_ned is not None:
        lat, lon, height = moved_geodetic(lat, lon, height, events.offset_ned)
    positions = CameraPositions(
        events.images,
        events.time,
        lat,
        lon,
        height,
        cov,
        quality,
        np.full(time.size, float(events.offset_ned is not None)),
        fixes.gps_week if events.gps_week is None else events.gps_week,
        events.source,
    )
    return positions, (_check_offsets(events), _check_interpolation(interpolation_sd))


def exposures_between(
    path: Path, fixes: Path, match: ImageMatch, time_scale: str | None, delay_s: float
) -> tuple[CameraPositions, tuple[str, ...]]:
    """Place the exposures of a file between the fixes of another one.

    Parameters
    ----------
    path, fixes : Path
        Exposures of any format, positions of the antenna.
    match : ImageMatch
        The images that name the exposures.
    time_scale : str, optional
        Scale of dates that do not say it.
    delay_s : float
        From a stamp to the middle of the exposure, s.

    Returns
    -------
    positions : CameraPositions
        As `camera_positions` has them.
    notes : tuple of str
        What a reader should know of the match and the interpolation.
    """
    events = named(events_of(path, match.image_ending, time_scale=time_scale), match)
    positions, (_, interpolated) = camera_positions(read_gnss(fixes), delay_events(events, delay_s))
    notes = [f"{note.name}: {note.found}" for note in (*events.notes, interpolated)]
    if outside := len(events) - len(positions):
        notes.append(f"{outside} of {len(events)} exposures lie outside of {fixes.name}")
    return positions, tuple(notes)


def _covariance(fixes: GnssFixes, time: Array, sigma_s: Array | None) -> tuple[Array, Array]:
    """Return P (n, 3, 3), m^2 (C.1), and the sigma (n,), m, of the interpolation in it."""
    later = np.clip(np.searchsorted(fixes.time, time), 1, fixes.time.size - 1)
    width = fixes.time[later] - fixes.time[later - 1]
    share = np.clip((time - fixes.time[later - 1]) / width, 0.0, 1.0)
    usual_width = float(np.median(np.diff(fixes.time)))
    position = geodetic_to_ecef(fixes.lat, fixes.lon, fixes.height)
    sd_near_fix = TO_MIDDLE * interpolation_error(fixes.time, position)
    interpolation_sd = (
        np.maximum(sd_near_fix[later - 1], sd_near_fix[later])
        * (4.0 * share * (1.0 - share))
        * (width / usual_width) ** WIDTH_EXPONENT
    )
    weight = share[:, None, None]
    cov = (1.0 - weight) * fixes.cov_ned[later - 1] + weight * fixes.cov_ned[later]
    cov = cov + interpolation_sd[:, None, None] ** 2 * np.eye(3)
    if sigma_s is not None:
        step = (position[later] - position[later - 1]) / width[:, None]
        velocity = np.einsum("nji,nj->ni", rotation_en(fixes.lat[later], fixes.lon[later]), step)
        along = velocity[:, :, None] * velocity[:, None, :]
        cov = cov + along * sigma_s[:, None, None] ** 2
    return cov, interpolation_sd


def interpolation_error(time: Array, position: Array) -> Array:
    """Return the rms (n,) m of an axis by which cubics through their neighbours miss n fixes.

    Parameters
    ----------
    time : ndarray, shape (n,)
        s.
    position : ndarray, shape (n, 3)
        m, Cartesian.

    Returns
    -------
    ndarray, shape (n,)
        Of the fixes around each one; zeros of fewer than five.
    """
    n = time.size
    if n < LEAST_FIXES:
        return np.zeros(n)
    rows = np.arange(2, n - 2)
    around = rows[:, None] + np.array([-2, -1, 1, 2])
    predicted = cubic(time[around], position[around] - position[rows][:, None], time[rows])
    square = np.mean(predicted**2, axis=1)
    span = np.ones(2 * NEIGHBOURS + 1)
    total = np.convolve(square, span)[NEIGHBOURS:][: square.size]
    count = np.convolve(np.ones(square.size), span)[NEIGHBOURS:][: square.size]
    return np.asarray(np.sqrt(total / count)[np.clip(np.arange(n) - 2, 0, rows.size - 1)])


def _check_offsets(events: CameraEvents) -> Finding:
    """Report whether positions are of the camera or of the antenna, and their distance, mm."""
    ask = Question("camera positions", "of the camera: offsets from the antenna (.MRK)")
    if events.offset_ned is not None:
        distance_mm = 1e3 * np.linalg.norm(events.offset_ned, axis=1)
        return ask.ok(
            f"{distance_mm.size} of the camera, {distance_mm.min():.0f} to"
            f" {distance_mm.max():.0f} mm from the antenna"
        )
    return ask.note(
        f"{events.time.size} of the antenna's phase centre, since the events state no offset",
        "give the bundle adjustment the lever arm, or process the flight with its IMU",
    )


def _check_interpolation(sigma_m: Array) -> Finding:
    """Compare the largest sigma (n,), m, of the interpolation with its limit."""
    return Question("camera interpolation", f"{1e3 * LARGE_M:.0f} mm").note(
        f"standard deviation {1e3 * float(np.median(sigma_m)):.1f} mm in the median,"
        f" {1e3 * float(sigma_m.max()):.1f} mm at most",
        "log the rover faster, or process the flight with its IMU",
        when=float(sigma_m.max()) > LARGE_M,
    )
