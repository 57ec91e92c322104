"""The vehicle's target at the exposures of the images, with the covariance of all places."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ....base.errors import InputError, near
from ....flight.config.block_tables.vehicle import VehicleTable
from ....geodesy.conventions import time_scale
from ....geodesy.frames import TangentPlane
from ....geodesy.gpstime import WEEK_S
from ....io.formats.blocks.image_points import ImagePoints
from ....io.formats.blocks.joined import match_names
from ....io.formats.vehicle.target_sizes import read_target_sizes
from ....records import ExteriorOrientation
from ....records.block import Array, ImageBlock
from ....records.rows import covariance_of_rows, rows_of
from .observed import observed_target, without
from .track import Track, read_track, rows_by_name, week_shift

TWO_CLOCKS = "two clocks that do not agree"  # of stamps of no other time scale
EVENT_S = 0.02
"""Stamps of one exposure by two recorders, of the vehicle and of the drone, differ by less."""
OTHER_EVENT_S = 0.5  # beyond it stamps are of other time scales or of the next exposure (chosen)
REPORTED_S = 1e-3  # least difference of stamps that is reported: 2 cm at 20 m/s
Rows = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Vehicle:
    """A vehicle's target at n exposures.

    Parameters
    ----------
    options : VehicleTable
        What was asked for.
    images, points : tuple of str
        (n,) the image that sees it, and its point there.
    time : ndarray
        (n,) stamps of the exposures, s; NaN where they are not known.
    track : Track
        The whole way, in the axes and the GPS week of the block.
    exposures : Track
        Its places at the exposures.
    cov : ndarray
        (3 n, 3 n) covariance of these places, m^2.
    size_px, size_sigma_px : ndarray
        (n,) apparent sizes, NaN of images without one.
    """

    options: VehicleTable
    images: tuple[str, ...]
    points: tuple[str, ...]
    time: Array
    track: Track
    exposures: Track
    cov: Array
    size_px: Array
    size_sigma_px: Array

    def rows(self, rows: Rows) -> "Vehicle":
        """Return some of the exposures."""
        fields = ("images", "points", "time", "size_px", "size_sigma_px")
        cov = covariance_of_rows(self.cov, rows, 3)
        exposures = self.exposures.rows(rows)
        return replace(self, **rows_of(self, rows, fields), exposures=exposures, cov=cov)

    def rows_in(self, block: ImageBlock) -> tuple[Rows, Rows, Rows]:
        """Return the rows of its images, points and image observations in a block.

        Parameters
        ----------
        block : ImageBlock
            The block that sees it.

        Returns
        -------
        tuple of ndarray
            (n,) each.
        """
        of_image = {name: k for k, name in enumerate(block.images)}
        of_point = {name: k for k, name in enumerate(block.points)}
        of_ray = {p: k for k, p in enumerate(block.observations.point.tolist())}
        image = np.array([of_image[name] for name in self.images], dtype=np.int64)
        point = np.array([of_point[name] for name in self.points], dtype=np.int64)
        return image, point, np.array([of_ray[p] for p in point.tolist()], dtype=np.int64)

    def seen_in(self, measured: ImagePoints) -> "Vehicle":
        """Return the exposures whose measurement of the target is among image observations."""
        observations = measured.observations
        seen_points = {measured.points[p] for p in np.unique(observations.point)}
        rows = [k for k, name in enumerate(self.points) if name in seen_points]
        return self if len(rows) == len(self.points) else self.rows(np.array(rows, dtype=np.int64))


def vehicle_of(
    options: VehicleTable,
    measured: ImagePoints,
    ground: Sequence[str],
    eo: ExteriorOrientation | None,
    notes: list[str],
) -> tuple[ImagePoints, Vehicle]:
    """Read the vehicle and join it with the images that see its target.

    Parameters
    ----------
    options : VehicleTable
        Table [vehicle] of the block file; it has a file.
    measured : ImagePoints
        All image observations.
    ground : sequence of str
        Names of ground points.
    eo : ExteriorOrientation, optional
        The aerial control, whose stamps are those of the exposures.
    notes : list of str
        Gets a sentence where something was assumed or left out.

    Returns
    -------
    measured : ImagePoints
        Image observations in which the target is a point of its own in every image.
    vehicle : Vehicle
        The target at the exposures.

    Raises
    ------
    InputError
        A file cannot be read, or files do not belong together.
    """
    views = observed_target(measured, options.target, ground)
    if views.divided:
        notes.append(
            f"point {views.divided[0]!r}"
            + (f" and {len(views.divided) - 1} more" if len(views.divided) > 1 else "")
            + " of the vehicle had one name in several images, where it had moved in between: it is"
            f" a point of its own in each, such as {views.points[0]!r}"
        )
    if options.skip:
        views = without(views, options.skip)
    return views.measured, placed_vehicle(options, views.images, views.points, eo, notes)


def placed_vehicle(
    options: VehicleTable,
    images: Sequence[str],
    points: Sequence[str],
    eo: ExteriorOrientation | None,
    notes: list[str],
) -> Vehicle:
    """Read the vehicle and place its target at the exposures of images.

    Parameters
    ----------
    options : VehicleTable
        Table [vehicle] of the block file; it has a file.
    images, points : sequence of str
        (n,) the images, and what the target is called in each.
    eo : ExteriorOrientation, optional
        The aerial control, whose stamps are those of the exposures.
    notes : list of str
        Gets a sentence where something was assumed or left out.

    Returns
    -------
    Vehicle
        Of the exposures at which its place is known.

    Raises
    ------
    InputError
        The file cannot be read, or has none of the exposures.
    """
    plane = None if eo is None else TangentPlane(*eo.origin)
    track = read_track(options, plane, eo)
    time = np.full(len(images), np.nan)
    if eo is not None:
        rows = match_names(images, eo.images)
        time[rows >= 0] = eo.time[rows[rows >= 0]]
        if track.time is not None:
            shift = week_shift(eo.gps_week, track.week)
            track = replace(track, time=track.time + shift, week=eo.gps_week)
    placed, is_placed = at_exposures(options, track, images, time, notes)
    placed_rows = np.flatnonzero(is_placed).tolist()
    seen_in = tuple(images[k] for k in placed_rows)
    when = placed.time if placed.time is not None else time[is_placed]
    cov = placed.covariance(when)
    size, sigma = _sizes(options, seen_in, notes)
    names = tuple(points[k] for k in placed_rows)
    return Vehicle(options, seen_in, names, time[is_placed], track, placed, cov, size, sigma)


def at_exposures(
    options: VehicleTable,
    track: Track,
    images: Sequence[str],
    time: Array,
    notes: list[str],
) -> tuple[Track, NDArray[np.bool_]]:
    """Return the places at the exposures of images.

    Parameters
    ----------
    options : VehicleTable
        Table [vehicle].
    track : Track
        The way of the target.
    images : sequence of str
        (n,) the images.
    time : ndarray, (n,)
        Their stamps, NaN where they are not known.
    notes : list of str
        Gets a sentence where something was assumed or left out.

    Returns
    -------
    placed : Track
        A row an exposure that is covered.
    valid : ndarray of bool, (n,)
        Which are.

    Raises
    ------
    InputError
        None is: stamps of another week, scale or day, or names of other images.
    """
    path = options.file
    if (rows := rows_by_name(track, images)) is not None:
        valid = rows >= 0
        placed = track.rows(rows[valid])
        _compare_stamps(options, placed, time[valid], notes)
        if placed.time is None and np.isfinite(time[valid]).all():
            placed = _with_velocities(placed, time[valid])
        reason = "are not named in it"
    elif track.time is None:
        assert track.images is not None
        raise InputError.in_file(
            path,
            f"names none of the images that see the target, such as {images[0]!r};"
            f" {near(images[0], track.images[:200])}",
        )
    elif not np.isfinite(time).any():
        raise InputError.in_file(
            path,
            "has stamps, and nothing says when the images were exposed: give aerial control"
            " (eo.json), or name the image of each position",
        )
    elif track.kind == "eo":
        stamps = np.where(np.isfinite(time), time, np.inf)
        row = np.abs(track.time[None] - stamps[:, None]).argmin(axis=1)
        dt = time - track.time[row]
        valid = np.abs(dt) < EVENT_S
        placed = track.rows(row[valid])
        placed = replace(placed, position_m=placed.position_m + dt[valid, None] * placed.velocity)
        reason = f"have no event of the vehicle within {1e3 * EVENT_S:g} ms"
    else:
        if len(track.time) < 2:
            raise InputError.in_file(path, "one row; two are needed to interpolate")
        filled = np.where(np.isfinite(time), time, track.time[0] - 1e6)
        placed, valid = track.at(filled, options.longest_gap_s)
        placed = placed.rows(np.flatnonzero(valid))
        reason = f"lie outside its rows or in a gap of more than {options.longest_gap_s:g} s"
    if not valid.any():
        _refuse_stamps(options, track, time)
    if missing := int((~valid).sum()):
        notes.append(
            f"{missing} of {len(valid)} exposures of the vehicle's target {reason},"
            f" {images[int(np.argmin(valid))]} first: they have no kinematic ground control"
        )
    return placed, valid


def _with_velocities(placed: Track, time: Array) -> Track:
    """Return places that images name with the velocities of their order in time."""
    from .track import along_course

    if len(time) < 3:
        return replace(placed, time=time)
    order = np.argsort(time, kind="stable")
    if (np.diff(time[order]) <= 0.0).any():
        return placed
    velocity = np.empty_like(placed.position_m)
    velocity[order] = np.gradient(placed.position_m[order], time[order], axis=0)
    attitude = np.empty_like(placed.C_mv)
    attitude[order] = along_course(velocity[order])
    return replace(placed, time=time, velocity=velocity, C_mv=attitude)


def _compare_stamps(options: VehicleTable, placed: Track, time: Array, notes: list[str]) -> None:
    """Hold the stamps of two recorders of the same exposures against each other."""
    if placed.time is None or not np.isfinite(time).any():
        return
    difference_s = placed.time - time
    middle = float(np.nanmedian(difference_s))
    if abs(middle) > OTHER_EVENT_S:
        raise InputError.in_file(
            options.file,
            f"its stamps lie {middle:+.3f} s from those of the same images"
            f" ({time_scale(middle) or TWO_CLOCKS}); give both in one time scale, or"
            " vehicle.time_offset_s",
        )
    if np.nanmax(np.abs(difference_s - middle)) > EVENT_S:
        k = int(np.nanargmax(np.abs(difference_s - middle)))
        raise InputError.in_file(
            options.file,
            f"its stamp of image {placed.images[k] if placed.images else k} lies"
            f" {difference_s[k] - middle:+.3f} s from that of the image, while other stamps"
            " agree: events are joined with wrong images",
        )
    if abs(middle) > REPORTED_S:
        notes.append(
            f"stamps of the vehicle lie {1e3 * middle:+.1f} ms from those of the same images;"
            " the position of the vehicle is taken at its own stamp"
        )


def _refuse_stamps(options: VehicleTable, track: Track, time: Array) -> None:
    """Refuse a file that has none of the exposures."""
    stamps = time[np.isfinite(time)]
    assert track.time is not None
    a, b = float(track.time[0]), float(track.time[-1])
    first, last = float(stamps.min()), float(stamps.max())
    weeks = round((0.5 * (a + b) - 0.5 * (first + last)) / WEEK_S)
    offset_s = 0.5 * (a + b) - 0.5 * (first + last)
    text = (
        f"none of the {stamps.size} exposures that see the target ({first:.1f} to {last:.1f} s) is"
        f" within its {len(track.time)} rows ({a:.1f} to {b:.1f} s)"
    )
    for seconds in (weeks * WEEK_S, 3600.0 * round(offset_s / 3600.0)):
        if seconds and a - seconds <= last and first <= b - seconds:
            raise InputError.in_file(
                options.file,
                f"{text}, as if off by {time_scale(seconds) or TWO_CLOCKS}; correct its stamps",
            )
    raise InputError.in_file(
        options.file,
        f"{text}; give the vehicle's file of this flight"
        + (
            ", at a higher rate, or a larger vehicle.longest_gap_s"
            if a < last and first < b
            else ""
        ),
    )


def _sizes(options: VehicleTable, images: Sequence[str], notes: list[str]) -> tuple[Array, Array]:
    """Return the apparent sizes of the target in images, and their standard deviations."""
    size, sigma = np.full(len(images), np.nan), np.full(len(images), np.nan)
    if options.sizes is None:
        return size, sigma
    table = read_target_sizes(options.sizes)
    rows = match_names(table.images, images)
    ok = rows >= 0
    if not ok.any():
        raise InputError.in_file(
            options.sizes,
            f"neither image {table.images[0]!r} nor any other image of the table sees the"
            f" vehicle's target; {near(table.images[0], list(images)[:200])}",
        )
    size[rows[ok]], sigma[rows[ok]] = table.size_px[ok], table.sigma_px[ok]
    if not ok.all():
        notes.append(
            f"{int((~ok).sum())} sizes of the target take no part,"
            f" {table.images[int(np.argmin(ok))]} first: the vehicle's place there is not known"
        )
    return size, sigma
