"""Aerial control: poses of an orientation as observation groups, with mounting and flight lines.

One group is a flight line with the covariance of all its poses (`adjust.aerial`). What all lines
share, such as the tilt by a bias of the accelerometers, are unknowns of unit covariance, and each
line is weighed by the covariance of the rest. Where the dense covariance of the smoother is not
there, that of neighbours is chained, which forgets what biases have in common over a line, or each
image stands alone; the block file says which.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..adjust.aerial import (
    BORESIGHT,
    COMMON,
    DRIFT,
    LEVER_ARM,
    SHIFT,
    TIME_OFFSET,
    AerialControl,
    ParameterObservation,
    chained_covariance,
)
from ..adjust.groups import ObservationGroup, weight_of
from ..adjust.unknowns import Key
from ..base.errors import InputError
from ..config.block_file import AerialControlTable
from ..formats.orientation.eo_covariance import FILE, read_common_errors, read_eo_covariance
from ..orient.relative import line_pairs
from ..records import ExteriorOrientation
from ..records.block import Array
from .inputs import Inputs

MOUNTING = "mounting"
LONGEST_CHAIN = 200
Rows = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Control:
    """Aerial control of a block.

    Parameters
    ----------
    groups : tuple of ObservationGroup
        One a flight line, and the prior of each parameter.
    blocks : dict
        First values of the parameters.
    lines : tuple of ndarray
        Rows of the block's images of each flight line.
    covariance : str
        Which covariances weigh them: "strip", "chain", "image", or "none" without aerial control.
    """

    groups: tuple[ObservationGroup, ...]
    blocks: dict[Key, Array]
    lines: tuple[Rows, ...]
    covariance: str


def control_of(inputs: Inputs, options: AerialControlTable | None = None) -> Control:
    """Return the aerial control of a block as observation groups.

    Parameters
    ----------
    inputs : Inputs
        The block and its orientation.
    options : AerialControlTable, optional
        What is estimated besides the poses; by default as the block file has it.

    Returns
    -------
    Control
        Groups and parameters.

    Raises
    ------
    InputError
        A covariance is asked for that is not there, or velocities are needed and missing.
    """
    eo, options = inputs.eo, options or inputs.file.aerial_control
    if eo is None:
        return Control((), {}, (), "none")
    image_of = np.full(len(eo.images), -1, dtype=np.int64)
    own = inputs.eo_row >= 0
    image_of[inputs.eo_row[own]] = np.flatnonzero(own)
    kind, pieces = _pieces(eo, options)
    common = read_common_errors(_beside(options), eo) if kind == "strip" else None
    zeros = np.zeros((len(eo), 3))
    if options.time_offset_sigma_s > 0.0 and (eo.velocity_mps is None or eo.rate_radps is None):
        raise InputError.at_line(
            options.file,
            None,
            "no velocities of the images, which a delay needs; process the flight again, or leave"
            " aerial_control.time_offset_sigma_s out",
        )
    velocity = zeros if eo.velocity_mps is None else eo.velocity_mps
    rate = zeros if eo.rate_radps is None else eo.rate_radps
    shared = _shared(options)
    blocks: dict[Key, Array] = {(name, 0): value for name, (value, _) in shared.items()}
    groups: list[ObservationGroup] = [
        _prior((name, 0), value, sigma) for name, (value, sigma) in shared.items()
    ]
    lines: list[Rows] = []
    for rows, cov in pieces:
        seen = np.flatnonzero(image_of[rows] >= 0)
        if seen.size == 0:
            continue
        rows = rows[seen]
        columns = (6 * seen[:, None] + np.arange(6)).ravel()
        cov = cov[np.ix_(columns, columns)]
        parameters, factor = dict.fromkeys(shared, 0), None
        if common is not None and common.factor[rows].any():
            segment, factor = int(common.segment[rows[0]]), common.factor[rows]
            parameters[COMMON], cov = segment, common.rest(rows, cov)
            if (COMMON, segment) not in blocks:
                blocks[COMMON, segment] = np.zeros(factor.shape[2])
                one = np.eye(factor.shape[2])
                groups.append(ParameterObservation((COMMON, segment), 0.0 * one[0], one, COMMON))
        for name, sigma in ((SHIFT, options.shift_sigma_m), (DRIFT, options.drift_sigma_mps)):
            if sigma is not None and not (name == DRIFT and rows.size < 2):
                key = (name, len(lines))
                parameters[name] = key[1]
                blocks[key] = np.zeros(3)
                groups.append(_prior(key, np.zeros(3), np.array(sigma)))
        who = f"{options.file}: flight line from image {eo.images[rows[0]]}"
        groups.append(
            AerialControl(
                tuple(int(i) for i in image_of[rows]),
                eo.position_m[rows],
                eo.C_mc[rows],
                weight_of(cov, who),
                eo.time[rows],
                velocity[rows],
                rate[rows],
                parameters,
                common=factor,
            )
        )
        lines.append(image_of[rows])
    return Control(tuple(groups), blocks, tuple(lines), kind)


def _shared(options: AerialControlTable) -> dict[str, tuple[Array, Array]]:
    """Return first values and standard deviations of the parameters of the whole block."""
    shared: dict[str, tuple[Array, Array]] = {}
    if options.lever_arm_sigma_m is not None:
        shared[LEVER_ARM] = np.zeros(3), np.array(options.lever_arm_sigma_m)
    if options.boresight_sigma_deg > 0.0:
        shared[BORESIGHT] = np.eye(3), np.full(3, np.radians(options.boresight_sigma_deg))
    if options.time_offset_sigma_s > 0.0:
        shared[TIME_OFFSET] = np.zeros(1), np.array([options.time_offset_sigma_s])
    return shared


def _prior(key: Key, value: Array, sigma: Array) -> ParameterObservation:
    return ParameterObservation(key, value, np.diag(1.0 / sigma**2), MOUNTING)


def _beside(options: AerialControlTable) -> Path:
    return Path(options.file or ".").parent / FILE


def _pieces(
    eo: ExteriorOrientation, options: AerialControlTable
) -> tuple[str, Iterator[tuple[Rows, Array]]]:
    """Return which covariances weigh the poses, and rows with their covariance, line by line."""
    beside = _beside(options)
    kind: Any = options.covariance
    if kind == "auto":
        kind = "strip" if beside.is_file() else "chain" if eo.cross is not None else "image"
    if kind == "strip":
        return kind, _strips(eo, beside)
    if kind == "chain":
        if eo.cross is None:
            raise InputError.at_line(
                options.file,
                None,
                "no covariances of neighbours (images were left out), which"
                ' aerial_control.covariance = "chain" needs; take the whole file, or "image"',
            )
        return kind, _chains(eo)
    return kind, ((np.array([k]), eo.cov[k]) for k in range(len(eo)))


def _strips(eo: ExteriorOrientation, path: Path) -> Iterator[tuple[Rows, Array]]:
    rest = np.ones(len(eo), dtype=bool)
    for strip in read_eo_covariance(path, eo):
        rest[strip.rows] = False
        yield strip.rows, strip.cov
    for k in np.flatnonzero(rest):
        yield np.array([k]), eo.cov[k]


def _chains(eo: ExteriorOrientation) -> Iterator[tuple[Rows, Array]]:
    up = np.tile([0.0, 0.0, 1.0], (len(eo), 1))
    first, _ = line_pairs(eo.time, eo.position_m, up, eo.C_mc)
    follows = np.zeros(len(eo), dtype=bool)
    follows[first + 1] = True
    starts = np.flatnonzero(~follows)
    for begin, end in zip(starts, [*starts[1:], len(eo)], strict=True):
        for start in range(begin, end, LONGEST_CHAIN):
            rows = np.arange(start, min(start + LONGEST_CHAIN, end))
            yield rows, chained_covariance(eo[rows])
