"""Relative control of flight lines: which images are pairs, what weighs them, and where a weak
datum keeps a line determined that nothing else may hold.

Pairs are neighbours among the images of a strip that lie in one flight line
(`navigation.orient.relative`, which leaves out turns) and not more than `aerial_control.gap_s`
apart. Images that no pair ties together are chains of their own; each chain has one weak datum.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ....flight.config.block_tables.aerial_control import AerialControlTable
from ....navigation.orient.relative import line_numbers, line_pairs
from ....records import ExteriorOrientation
from ....records.block import Array
from ....records.relative import GAP_S
from ....records.rows import covariance_of_rows
from ...adjust.aerial import BORESIGHT, COMMON_OF_TRAJECTORY, SHIFT, AerialControl
from ...adjust.groups import ObservationGroup, weight_of
from ...adjust.precision import GroupTest
from ...adjust.relative import (
    Datum,
    GyroNoise,
    ObservedStrip,
    RelativeAerialControl,
    as_printed,
    operator,
    relative_covariance,
)

Rows = NDArray[np.int64]
WEAK_DATUM = "weak datum"
UP = np.array([0.0, 0.0, 1.0])  # of the tangent plane
HELD_BY_NOTHING = 0.99
"""Redundancy number of a weak datum below which the rest knows it no ten times better than it does
itself: several data of lines that tie points join are redundant of each other."""


class StripErrors(NamedTuple):
    """Images of a strip, and what is known of their errors.

    Parameters
    ----------
    rows : (n,) rows in the orientation, increasing.
    images : (n,) rows in the block.
    cov : (6 n, 6 n) covariance of their poses, without what `factor` says.
    factor : (n, 6, q) their poses by the errors that all strips share, or None.
    parameters : row of the block that stands for each parameter.
    """

    rows: Rows
    images: Rows
    cov: Array
    factor: Array | None
    parameters: dict[str, int]

    def poses(
        self, eo: ExteriorOrientation, motion: tuple[Array, Array], weight: Array
    ) -> tuple[tuple[int, ...], Array, Array, Array, Array, Array, Array]:
        """Return what a group of the strip is made of, up to its parameters.

        Parameters
        ----------
        eo : ExteriorOrientation
            The orientation.
        motion : tuple of ndarray
            (n, 3) velocities, m/s, and rates, rad/s, of all its images.
        weight : ndarray
            Weight of the group.

        Returns
        -------
        tuple
            As `StripControl` has it.
        """
        rows, (velocity, rate) = self.rows, motion
        pose = eo.position_m[rows], eo.C_mc[rows], weight
        return tuple(self.images.tolist()), *pose, eo.time[rows], velocity[rows], rate[rows]


def flight_lines(eo: ExteriorOrientation) -> list[Rows]:
    """Return the rows of the images of each flight line, in order; an image in none is by itself.

    Parameters
    ----------
    eo : ExteriorOrientation
        The images, by time.
    """
    number = line_numbers(eo.time, eo.position_m, np.tile(UP, (len(eo), 1)), eo.C_mc, GAP_S)
    begins = (np.diff(number) != 0) | (number[1:] == 0)
    return np.split(np.arange(len(eo)), np.flatnonzero(begins) + 1)


def chains(eo: ExteriorOrientation, gap_s: float) -> Rows:
    """Number the images that pairs tie together: lines that meet in an image are one chain.

    Parameters
    ----------
    eo : ExteriorOrientation
        The images.
    gap_s : float
        Longest time between the images of a pair, s.

    Returns
    -------
    ndarray of int, (n,)
        The same number for images of one chain, increasing; an image in none has its own.
    """
    first, _ = line_pairs(eo.time, eo.position_m, np.tile(UP, (len(eo), 1)), eo.C_mc, gap_s)
    follows = np.zeros(len(eo), dtype=bool)
    follows[first + 1] = True
    return np.cumsum(~follows).astype(np.int64)


def absolute_group(
    strip: StripErrors,
    control: str,
    eo: ExteriorOrientation,
    motion: tuple[Array, Array],
    options: AerialControlTable,
) -> AerialControl:
    """Return absolute control of a strip as an observation group.

    Parameters
    ----------
    strip : StripErrors
        Its images and their errors.
    control : str
        "Ap/Aa", or "Ap" of positions alone.
    eo : ExteriorOrientation
        The orientation.
    motion : tuple of ndarray
        (n, 3) velocities, m/s, and rates, rad/s, of all its images.
    options : AerialControlTable
        Names the file.

    Returns
    -------
    AerialControl
        The group.
    """
    cov, parameters = strip.cov, strip.parameters
    if control == "Ap":
        cov = covariance_of_rows(cov, 2 * np.arange(strip.rows.size), 3)
        parameters = {p: k for p, k in parameters.items() if p != BORESIGHT}
    weight = weight_of(cov, f"{options.file}: flight line from image {eo.images[strip.rows[0]]}")
    return AerialControl(*strip.poses(eo, motion, weight), parameters, common=strip.factor)


def relative_groups(
    strip: StripErrors,
    control: str,
    eo: ExteriorOrientation,
    motion: tuple[Array, Array],
    chain: Rows,
    options: AerialControlTable,
) -> list[ObservationGroup]:
    """Return relative control of a strip as observation groups.

    Parameters
    ----------
    strip : StripErrors
        Its images and their errors.
    control : str
        "Ap/Ra", "Rp/Ra" or "Rp".
    eo : ExteriorOrientation
        The orientation.
    motion : tuple of ndarray
        (n, 3) velocities, m/s, and rates, rad/s, of all its images.
    chain : ndarray of int
        Number of the chain of all its images (`chains`).
    options : AerialControlTable
        Weights, gaps, standard deviations of the datum.

    Returns
    -------
    list of ObservationGroup
        One of all pairs, where there are any, and a weak datum of each chain.
    """
    rows = strip.rows
    position, turns = control.startswith("Rp"), control.endswith("Ra")
    follows = (np.diff(chain[rows]) == 0) & (np.diff(eo.time[rows]) <= options.gap_s)
    pairs = np.flatnonzero(follows)[:, None] + np.arange(2)
    observed = ObservedStrip("relative" if position else "absolute", turns, pairs)
    groups: list[ObservationGroup] = []
    left_out = {BORESIGHT, SHIFT} if position else {BORESIGHT}
    parameters = {p: k for p, k in strip.parameters.items() if p not in left_out}
    C, factor = eo.C_mc[rows], None
    if sum(observed.sizes(rows.size)):
        if options.relative_weights == "smoothed":
            L = operator(C, observed)
            cov = relative_covariance(L, strip.cov)
            if strip.factor is not None:
                factor = np.asarray(L @ strip.factor.reshape(6 * rows.size, -1))
        else:
            gyro = None
            if options.relative_weights == "gyro":
                gyro = GyroNoise(
                    np.radians(options.gyro_noise_deg_rts),
                    np.radians(options.gyro_drift_degps),
                    options.gyro_vertical,
                )
            cov = as_printed(strip.cov, C, observed, eo.time[rows], gyro)
        if factor is None:
            parameters.pop(COMMON_OF_TRAJECTORY, None)
        who = f"{options.file}: relative control from image {eo.images[rows[0]]}"
        poses = strip.poses(eo, motion, weight_of(cov, who))
        groups.append(RelativeAerialControl(*poses, parameters, common=factor, observed=observed))
    sigma = (
        options.datum_sigma_m if position else np.inf,
        float(np.radians(options.datum_sigma_deg)) if turns else np.inf,
    )
    for tied in np.split(np.arange(rows.size), np.flatnonzero(~follows) + 1):
        middle = int(tied[tied.size // 2])
        i, size = int(strip.images[middle]), int(tied.size)
        groups.append(Datum(i, eo.position_m[rows[middle]], C[middle], sigma, size, WEAK_DATUM))
    return groups


def weakly_held(groups: Sequence[ObservationGroup], tests: Sequence[GroupTest]) -> list[Datum]:
    """Find the chains of images that nothing but their weak datum holds.

    Parameters
    ----------
    groups : sequence of ObservationGroup
        The groups of the adjustment.
    tests : sequence of GroupTest
        Their tests.

    Returns
    -------
    list of Datum
        The datum of each.
    """
    return [
        group
        for group, test in zip(groups, tests, strict=True)
        if isinstance(group, Datum) and test.redundancy.min() < HELD_BY_NOTHING
    ]
