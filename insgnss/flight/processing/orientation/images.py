"""The images of each camera within the segments, their instants, their errors by the states."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ....geodesy.frames import TangentPlane
from ....io.exposures.rig import CameraExposures, ExposedRows
from ....navigation.filter.covariances import ChainAgain
from ....navigation.filter.event_chain import EventChain
from ....navigation.filter.event_clock import (
    at_uncertain_times,
    event_derivatives,
    receiver_events,
)
from ....navigation.filter.trajectory import trajectory
from ....navigation.orient.exterior import pose_derivatives
from ....records import Array, Trajectory
from ....records.cameras.mounting import Mounting
from ...config.flight_file import Flight
from ..recording import Recording
from ..segment import Segment


def chain_of(segment: Segment) -> EventChain | ChainAgain:
    """Return what ties the camera events of a segment, which was solved with it.

    Parameters
    ----------
    segment : Segment
        A solved segment.

    Returns
    -------
    EventChain or ChainAgain
        The second of more events than are kept.
    """
    assert segment.solution.chain is not None, "the problem was solved without it"
    return segment.solution.chain


class Instants:
    """The instants of the exposures of a segment, by the clock that stamped them.

    Parameters
    ----------
    segment : Segment
        A solved segment.
    of_receiver : bool
        Whether the receiver stamped them.
    gps_week : int
        The GPS week whose seconds the stamps count.
    neighbours : bool
        Whether the covariances of neighbours are wanted.
    """

    def __init__(
        self, segment: Segment, of_receiver: bool, gps_week: int, neighbours: bool
    ) -> None:
        solution = segment.solution
        self.segment, self.of_receiver = segment, of_receiver
        self.trajectory = (
            receiver_events(solution, gps_week)
            if of_receiver
            else trajectory(solution, solution.event_epochs, gps_week, events=neighbours)
        )

    def derivatives(self, events: slice | np.ndarray) -> Array:
        """Return the derivatives of the navigation errors at some instants.

        Parameters
        ----------
        events : slice or ndarray
            The instants.

        Returns
        -------
        Array
            (instants, 9, n) by the errors of all states.
        """
        return event_derivatives(self.segment.solution, self.of_receiver, events)


@dataclass(frozen=True)
class CameraImages:
    """The images of a camera within the segments.

    Parameters
    ----------
    camera : CameraExposures
        All exposures of the camera.
    mounting : Mounting
        How it is mounted.
    instants : tuple of Instants
        Those of each segment.
    rows, segment, instant : ndarray of int
        (k,) row among the exposures, segment, and instant in it.
    exposed : Trajectory
        At the images, of stamps that are uncertain with what these make of it.
    """

    camera: CameraExposures
    mounting: Mounting
    instants: tuple[Instants, ...]
    rows: NDArray[np.int64]
    segment: NDArray[np.int64]
    instant: NDArray[np.int64]
    exposed: Trajectory

    @property
    def of_receiver(self) -> bool:
        """Whether the receiver stamped them."""
        return self.camera.clock == "receiver"

    def derivatives(
        self, segment: int, plane: TangentPlane, events: slice | NDArray[np.int64]
    ) -> Array:
        """Return the derivatives of its poses at some instants of a segment.

        Parameters
        ----------
        segment : int
            The segment.
        plane : TangentPlane
            Of the poses.
        events : slice or ndarray
            The instants.

        Returns
        -------
        Array
            (instants, 6, n) errors of position (m) and psi (rad) by those of all states.
        """
        instants = self.instants[segment]
        J = pose_derivatives(instants.trajectory[events], self.mounting, plane)
        return J @ instants.derivatives(events)


def images_of(
    flight: Flight, recording: Recording, segments: Sequence[Segment], neighbours: bool = True
) -> list[CameraImages]:
    """Return the images of each camera that has some in the segments.

    Parameters
    ----------
    flight : Flight
        The flight file.
    recording : Recording
        The recording, which holds the exposures.
    segments : sequence of Segment
        The solved segments.
    neighbours : bool
        Whether the covariances of neighbours are wanted.

    Returns
    -------
    list of CameraImages
        In the order of the cameras.
    """
    of_clock: dict[tuple[int, bool], Instants] = {}
    images = []
    for number, (camera, mounting) in enumerate(
        zip(recording.cameras, flight.mountings, strict=True)
    ):
        parts, instants = [], []
        for k, segment in enumerate(segments):
            chosen, key = segment.exposed[number], (k, camera.clock == "receiver")
            if key not in of_clock:
                of_clock[key] = Instants(segment, key[1], recording.gps_week, neighbours)
            instants.append(of_clock[key])
            if chosen.rows.size:
                parts.append(
                    (chosen, k, _trajectory_at_exposures(camera, chosen, of_clock[key].trajectory))
                )
        if parts:
            images.append(
                CameraImages(
                    camera,
                    mounting,
                    tuple(instants),
                    np.concatenate([chosen.rows for chosen, _, _ in parts]),
                    np.concatenate([np.full(chosen.rows.size, k) for chosen, k, _ in parts]),
                    np.concatenate([chosen.instant for chosen, _, _ in parts]),
                    Trajectory.joined([exposed for _, _, exposed in parts]),
                )
            )
    return images


def _trajectory_at_exposures(
    camera: CameraExposures, chosen: ExposedRows, at_instants: Trajectory
) -> Trajectory:
    """Return the trajectory at the exposures of a camera in a segment."""
    every = chosen.instant.size == len(at_instants)
    exposed = at_instants if every else at_instants[chosen.instant]
    if camera.events.sigma_s is None:
        return exposed
    return at_uncertain_times(exposed, camera.events.sigma_s[chosen.rows])
