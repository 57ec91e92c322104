"""The trajectory on the output grid, and the exterior orientation of the images."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ....base.errors import DataError
from ....geodesy.frames import TangentPlane
from ....navigation.filter.trajectory import dense_trajectory, trajectory
from ....navigation.orient.exterior import exterior_orientation
from ....navigation.orient.rig import rig_orientation
from ....records import ExteriorOrientation, GnssFixes, Trajectory
from ....records.cameras.rig import merged_order
from ...config.flight_file import Flight
from ..checks import refuse_unobservable
from ..estimation_problem import MOST_EPOCHS_HZ
from ..recording import Recording
from ..segment import Segment
from .images import images_of
from .rig_pairs import RigPairs

ORIGIN_DIGITS = 2  # decimals of a degree of the tangent plane's origin by default


def output_trajectory(flight: Flight, segments: Sequence[Segment], gps_week: int) -> Trajectory:
    """Recover the trajectory at the rate that the flight file asks for.

    Parameters
    ----------
    flight : Flight
        The flight file.
    segments : sequence of Segment
        The solved segments.
    gps_week : int
        The GPS week whose seconds the stamps count.

    Returns
    -------
    Trajectory
        The poses of all segments, of the navigation centre of the IMU.
    """
    hz = flight.output.trajectory_hz
    return Trajectory.joined(
        [
            trajectory(segment.solution, segment.grid, gps_week)
            if at_epochs(hz)
            else dense_trajectory(segment.solution, gps_week, hz)
            for segment in segments
        ]
    )


def at_epochs(hz: float | None) -> bool:
    """Tell whether the rows of the output are epochs, which need no increments between them.

    Parameters
    ----------
    hz : float or None
        `output.trajectory_hz`.

    Returns
    -------
    bool
        Whether the rate is at most `MOST_EPOCHS_HZ`.
    """
    return hz is not None and hz <= MOST_EPOCHS_HZ


def orient_images(
    flight: Flight,
    recording: Recording,
    segments: Sequence[Segment],
    history: tuple[str, ...],
) -> ExteriorOrientation | None:
    """Orient the images within the segments.

    Their times are those of the trajectory: an exposure that the receiver stamped is given the
    instant in the IMU's clock.

    Parameters
    ----------
    flight : Flight
        The flight file.
    recording : Recording
        The recording, which holds the exposures.
    segments : sequence of Segment
        The solved segments.
    history : tuple of str
        What was done, sentence by sentence; the result carries it.

    Returns
    -------
    ExteriorOrientation or None
        The orientation of each image in the tangent plane; None without a camera.

    Raises
    ------
    DataError
        Where no image lies in a segment, or the attitudes are not determined.
    """
    if not recording.cameras:
        return None
    images = images_of(flight, recording, segments)
    if not images:
        raise DataError(
            f"{recording.cameras[0].events.source}: no image lies in a segment that could be"
            " solved; see the gaps of `insgnss inspect`"
        )
    refuse_unobservable(flight, images[0].exposed)
    plane = tangent_plane(flight, segments[0].fixes)
    oriented = []
    for of_camera in images:
        taken = of_camera.camera.events[of_camera.rows]
        if of_camera.of_receiver:
            taken = replace(taken, time=of_camera.exposed.time)
        eo = exterior_orientation(of_camera.exposed, taken, of_camera.mounting, plane, history)
        oriented.append(replace(eo, datum=flight.gnss.datum, epoch=flight.gnss.epoch))
    if len(recording.cameras) == 1:
        return oriented[0]
    order, number = merged_order([eo.time for eo in oriented])
    cross = RigPairs(images, order, number, plane).of_neighbours()
    return rig_orientation(
        oriented, [of_camera.camera.name for of_camera in images], order, number, cross
    )


def tangent_plane(flight: Flight, fixes: GnssFixes) -> TangentPlane:
    """Return the tangent plane of the flight file, else at the first fix, rounded, height 0.

    Parameters
    ----------
    flight : Flight
        The flight file.
    fixes : GnssFixes
        The fixes of the first segment.

    Returns
    -------
    TangentPlane
        Of the orientation of all images.
    """
    if flight.tangent_plane is not None:
        return TangentPlane(*map(float, flight.tangent_plane.origin))
    near = np.radians(np.round(np.degrees([fixes.lat[0], fixes.lon[0]]), ORIGIN_DIGITS))
    return TangentPlane(float(near[0]), float(near[1]), 0.0)
