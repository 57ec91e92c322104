"""Aerial control: poses of an orientation as observation groups, with mounting and flight lines.

One group is a flight line with the covariance of all its poses (`photogrammetry.adjust.aerial`).
What all lines share, such as the tilt by a bias of the accelerometers, are unknowns of unit
covariance, and each line is weighed by the covariance of the rest. Where the dense covariance of
the smoother is not there, that of neighbours is chained, which forgets what biases have in common
over a line, or each image stands alone; the block file says which.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....base.errors import InputError, near
from ....base.received.nesting import read_object
from ....flight.config.block_tables.aerial_control import AerialControlTable
from ....io.formats.blocks.joined import match_names
from ....io.formats.orientation.eo_covariance import FILE, read_common_errors, read_eo_covariance
from ....records import ExteriorOrientation
from ....records.block import Array
from ....records.relative import GAP_S
from ....records.rows import covariance_of_rows
from ...adjust.aerial import (
    COMMON_OF_TRAJECTORY,
    LINE_DRIFT,
    SHIFT,
    CorrelatedShifts,
    ParameterObservation,
    chained_covariance,
    slow_errors,
)
from ...adjust.groups import ObservationGroup
from ...adjust.unknowns import Key
from ..inputs import BlockInputs
from ..parameters import MOUNTING_PARAMETERS, prior, priors
from .relative import StripErrors, absolute_group, chains, flight_lines, relative_groups

SHORTEST_STEP_S = 1e-3  # between images: no camera is as fast, and equal stamps divide by nothing
LONGEST_CHAIN_IMAGES = 200  # of one group (chosen): its dense covariance is 1200 x 1200, 12 MB
RELATIVE = ("Ap/Ra", "Rp/Ra", "Rp")
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
    of_lines : tuple of str
        What is observed of each flight line, such as "Ap/Ra".
    """

    groups: tuple[ObservationGroup, ...]
    blocks: dict[Key, Array]
    lines: tuple[Rows, ...]
    covariance: str
    of_lines: tuple[str, ...] = ()


def control_of(inputs: BlockInputs, whole: Sequence[tuple[Rows, Array]] | None = None) -> Control:
    """Return the aerial control of a block as observation groups.

    Parameters
    ----------
    inputs : BlockInputs
        The block and its orientation.
    whole : sequence of tuple, optional
        Rows of the orientation and the covariance of their poses, in the place of flight lines.

    Returns
    -------
    Control
        Groups and parameters.

    Raises
    ------
    InputError
        A covariance is asked for that is not there, or velocities are needed and missing.
    """
    eo, options = inputs.eo, inputs.file.aerial_control
    if eo is None or inputs.file.adjustment.mode == "indirect":
        return Control((), {}, (), "none")
    image_of = np.full(len(eo.images), -1, dtype=np.int64)
    with_pose = inputs.eo_row >= 0
    image_of[inputs.eo_row[with_pose]] = np.flatnonzero(with_pose)
    kind, pieces = _pieces(eo, options) if whole is None else ("whole", iter(whole))
    common = read_common_errors(_beside(options), eo) if kind == "strip" else None
    motion, chain = _motion(eo, options), chains(eo, options.gap_s)
    other_lines = _other_lines(eo, options)
    shared = priors(inputs.file, MOUNTING_PARAMETERS)
    blocks: dict[Key, Array] = {one.key: one.value for one in shared}
    groups: list[ObservationGroup] = [*shared]
    lines: list[Rows] = []
    stamps: list[Array] = []
    controls: list[str] = []
    slow = options.shift_sigma_m is not None and options.shift_correlation_s > 0.0
    for piece, cov_of_piece in pieces:
        control = _control_of_line(piece, other_lines, eo, options)
        in_block = np.flatnonzero(image_of[piece] >= 0)
        if in_block.size == 0:
            continue
        rows = piece[in_block]
        cov = covariance_of_rows(cov_of_piece, in_block)
        parameters, factor = dict(one.key for one in shared), None
        printed = control in RELATIVE and options.relative_weights != "smoothed"
        if common is not None and common.factor[rows].any() and not printed:
            segment, factor = int(common.segment[rows[0]]), common.factor[rows]
            parameters[COMMON_OF_TRAJECTORY], cov = segment, common.rest(rows, cov)
            if (COMMON_OF_TRAJECTORY, segment) not in blocks:
                blocks[COMMON_OF_TRAJECTORY, segment] = np.zeros(factor.shape[2])
                one = np.eye(factor.shape[2])
                groups.append(
                    ParameterObservation(
                        (COMMON_OF_TRAJECTORY, segment), 0.0 * one[0], one, COMMON_OF_TRAJECTORY
                    )
                )
        for name, sigma in ((SHIFT, options.shift_sigma_m), (LINE_DRIFT, options.drift_sigma_mps)):
            if sigma is not None and not (name == LINE_DRIFT and rows.size < 2):
                key = (name, len(lines))
                parameters[name] = key[1]
                blocks[key] = np.zeros(3)
                if not (slow and name == SHIFT):
                    groups.append(prior(key, np.zeros(3), np.array(sigma)))
        if slow:
            _, (within,) = slow_errors([eo.time[rows]], *_slow(options))
            positions = (6 * np.arange(rows.size)[:, None] + np.arange(3)).ravel()
            cov = cov.copy()
            cov[np.ix_(positions, positions)] += within
        strip = StripErrors(rows, image_of[rows], cov, factor, parameters)
        if control in RELATIVE:
            groups += relative_groups(strip, control, eo, motion, chain, options)
        else:
            groups.append(absolute_group(strip, control, eo, motion, options))
        lines.append(image_of[rows])
        stamps.append(eo.time[rows])
        controls.append(control)
    if slow and lines:
        shifts, _ = slow_errors(stamps, *_slow(options))
        groups.append(CorrelatedShifts(tuple((SHIFT, k) for k in range(len(lines))), shifts))
    return Control(tuple(groups), blocks, tuple(lines), kind, tuple(controls))


def _slow(options: AerialControlTable) -> tuple[Array, float]:
    """Return sigmas and correlation time of the slow error of the fixes."""
    return np.array(options.shift_sigma_m), options.shift_correlation_s


def processed_with(inputs: BlockInputs) -> Mapping[str, Any] | None:
    """Return the flight file of an orientation as the report beside its eo.json has it.

    Parameters
    ----------
    inputs : BlockInputs
        The block.

    Returns
    -------
    mapping or None
        Its tables; None where no report says them.
    """
    if inputs.file.aerial_control.positions_alone:
        return None
    beside = Path(inputs.file.aerial_control.file or ".").parent / "report.json"
    flight = read_object(beside).get("flight")
    return flight if isinstance(flight, dict) and "mounting" in flight else None


def motion_is_known(eo: ExteriorOrientation, options: AerialControlTable) -> bool:
    """Tell whether a delay of the exposures can be estimated."""
    if options.positions_alone:
        return eo.gps_week > 0
    return eo.velocity_mps is not None and eo.rate_radps is not None


def _motion(eo: ExteriorOrientation, options: AerialControlTable) -> tuple[Array, Array]:
    """Return velocities and rates of the images, zero where they are not known and not needed."""
    if options.positions_alone and motion_is_known(eo, options):
        return velocities_by_differences(eo), np.zeros((len(eo), 3))
    if options.time_offset_sigma_s > 0.0 and not motion_is_known(eo, options):
        raise InputError.in_file(
            options.file,
            "no velocities of the images, which a delay needs; process the flight again, or leave"
            " aerial_control.time_offset_sigma_s out",
        )
    zeros = np.zeros((len(eo), 3))
    return (
        zeros if eo.velocity_mps is None else eo.velocity_mps,
        zeros if eo.rate_radps is None else eo.rate_radps,
    )


def motion_of_images(inputs: BlockInputs) -> tuple[Array, Array]:
    """Return velocities (n, 3), m/s, and rates (n, 3), rad/s, of the images of a block.

    Parameters
    ----------
    inputs : BlockInputs
        The block and its orientation.

    Returns
    -------
    tuple of ndarray
        In the axes of the block, zero where they are not known.
    """
    if inputs.eo is None:
        velocity, rate = np.zeros((2, len(inputs.block.images), 3))
        return velocity, rate
    velocity, rate = _motion(inputs.eo, inputs.file.aerial_control)
    return inputs.of_images(velocity), inputs.of_images(rate)


def velocities_by_differences(eo: ExteriorOrientation) -> Array:
    """Return velocities (n, 3), m/s, of positions by the differences to their neighbours in time.

    The nearer of both neighbours counts by the fourth power of the intervals, so that at the end of
    a flight line the turn to the next one, which takes longer, has no part. That of an image
    without neighbour within `GAP_S` is not known, and zero.
    """
    if len(eo) < 2:
        return np.zeros((len(eo), 3))
    step = np.maximum(np.diff(eo.time), SHORTEST_STEP_S)
    slope = np.diff(eo.position_m, axis=0) / step[:, None]
    before, after = np.append(np.inf, step), np.append(step, np.inf)
    ahead = (1.0 / (1.0 + (after / before) ** 4))[:, None]
    first, last = np.vstack([slope[:1], slope]), np.vstack([slope, slope[-1:]])
    has_neighbour = (np.minimum(before, after) <= GAP_S)[:, None]
    return np.where(has_neighbour, ahead * last + (1.0 - ahead) * first, 0.0)


def _other_lines(eo: ExteriorOrientation, options: AerialControlTable) -> dict[int, str]:
    """Return the control that aerial_control.lines asks for, by the row of the named image."""
    names = tuple(options.of_lines)
    rows = match_names(names, eo.images)
    for name, row in zip(names, rows, strict=True):
        if row < 0:
            raise InputError(
                f"aerial_control.lines: {name!r} is no image of the aerial control;"
                f" {near(name, eo.images[:200])}"
            )
    return {int(row): options.of_lines[name] for name, row in zip(names, rows, strict=True)}


def _control_of_line(
    rows: Rows, other_lines: dict[int, str], eo: ExteriorOrientation, options: AerialControlTable
) -> str:
    """Return the control of the flight line with these images."""
    requested = {other_lines[int(row)]: eo.images[row] for row in rows if int(row) in other_lines}
    if len(requested) > 1:
        (one, first), (two, second) = list(requested.items())[:2]
        raise InputError(
            f"aerial_control.lines: {first} and {second} lie in one flight line, which cannot be"
            f" both {one} and {two}; name one of them"
        )
    return next(iter(requested), options.control)


def _beside(options: AerialControlTable) -> Path:
    return Path(options.file or ".").parent / FILE


def _pieces(
    eo: ExteriorOrientation, options: AerialControlTable
) -> tuple[str, Iterator[tuple[Rows, Array]]]:
    """Return which covariances weigh the poses, and rows with their covariance, line by line."""
    from scipy.linalg import block_diag

    beside = _beside(options)
    kind: Any = options.covariance
    if options.positions_alone:
        if kind not in ("auto", "image"):
            raise InputError.in_file(
                options.file,
                f'has no covariances of neighbours, which aerial_control.covariance = "{kind}"'
                ' needs; take "auto"',
            )
        return "image", ((rows, block_diag(*eo.cov[rows])) for rows in _lines(eo))
    if kind == "auto":
        kind = "strip" if beside.is_file() else "chain" if eo.cross is not None else "image"
    if kind == "strip":
        return kind, _strips(eo, beside)
    if kind == "chain":
        if eo.cross is None:
            raise InputError.in_file(
                options.file,
                "no covariances of neighbours (images were left out), which"
                ' aerial_control.covariance = "chain" needs; take the whole file, or "image"',
            )
        return kind, ((rows, chained_covariance(eo[rows])) for rows in _lines(eo))
    if any(control in RELATIVE for control in (options.control, *options.of_lines.values())):
        return kind, ((rows, block_diag(*eo.cov[rows])) for rows in _lines(eo))
    return kind, ((np.array([k]), eo.cov[k]) for k in range(len(eo)))


def _strips(eo: ExteriorOrientation, path: Path) -> Iterator[tuple[Rows, Array]]:
    single = np.ones(len(eo), dtype=bool)
    for strip in read_eo_covariance(path, eo):
        single[strip.rows] = False
        yield strip.rows, strip.cov
    for k in np.flatnonzero(single):
        yield np.array([k]), eo.cov[k]


def _lines(eo: ExteriorOrientation) -> Iterator[Rows]:
    """Return the rows of the images of each flight line, of a long one in pieces."""
    for rows in flight_lines(eo):
        yield from (
            rows[k : k + LONGEST_CHAIN_IMAGES] for k in range(0, rows.size, LONGEST_CHAIN_IMAGES)
        )
