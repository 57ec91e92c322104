"""The adjustment of a block: gross errors, variances by components, and trials of what it lacks."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...base.errors import DataError
from ...records.block import Array, ImageBlock
from ..adjust.adjustment import Adjusted, adjust_problem
from ..adjust.direct import intersected_points
from ..adjust.groups import ObservationGroup, PointObservation, control_points
from ..adjust.normals import Problem, problem_of
from ..adjust.outliers import Cleaned, RejectedControl, without_outliers
from ..adjust.precision import IMAGE, Precision, VarianceComponent, precision_of
from ..adjust.shutter import without_readout
from ..adjust.start import first_values
from ..adjust.unknowns import Key, Unknowns
from ..adjust.variance_components import reweight_block
from .aerial.control import Control, control_of, motion_of_images
from .inputs import BlockInputs
from .vehicle.control import vehicle_control

GROUND_CONTROL = "ground control"
Progress = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class AdjustedBlock:
    """An adjusted block.

    Parameters
    ----------
    inputs : BlockInputs
        What it started from.
    control : Control
        Its aerial control.
    precision : Precision
        Values, covariances and tests; variances follow their components, that of unit weight is
        one.
    factors : dict
        By which the variances of a kind were multiplied, by its name.
    rejected : ndarray of int
        Rows of the image observations that were rejected.
    rejected_control : tuple of RejectedControl
        Ground control points that were rejected.
    iterations : int
        Steps of the adjustment from the first values, before variances were multiplied.
    """

    inputs: BlockInputs
    control: Control
    precision: Precision
    factors: dict[str, float]
    rejected: NDArray[np.int64]
    rejected_control: tuple[RejectedControl, ...]
    iterations: int

    @property
    def direct(self) -> bool:
        """Whether points were intersected from poses that were held."""
        return self.inputs.file.adjustment.mode == "direct"

    @property
    def result(self) -> Adjusted:
        """The adjustment."""
        return self.precision.result

    @property
    def components(self) -> tuple[VarianceComponent, ...]:
        """Variance components with the variances that were taken at last."""
        return self.precision.components()


def solve_block(inputs: BlockInputs, progress: Progress) -> AdjustedBlock:
    """Adjust a block.

    Parameters
    ----------
    inputs : BlockInputs
        The block.
    progress : callable
        Is called with the name of each step.

    Returns
    -------
    AdjustedBlock
        The adjustment.

    Raises
    ------
    DataError
        The observations do not determine the unknowns, or the iteration does not converge.
    """
    control = control_of(inputs)
    block = inputs.block
    if not (
        control.groups or len(block.control) or inputs.further or inputs.vehicle or block.held.any()
    ):
        raise DataError(
            "neither aerial control nor ground control: nothing says where the block lies; give"
            " eo.json, or ground points that are measured in images, or ask for a free network by"
            " --datum images"
        )
    progress(f"first values of {len(block.images)} images and {len(block.points)} points")
    if (readout := inputs.file.camera.readout_s) is not None:
        progress("readout of the shutter")
        block = _of_middle_rows(inputs, control, readout)
        inputs = replace(inputs, block=block)
    problem, values = set_up(inputs, control)
    options = inputs.file.adjustment
    if options.mode == "direct":
        return _intersect_points(inputs, control, problem, values, progress)
    progress(f"adjusting {len(block.observations)} image observations")
    if options.keep_all:
        cleaned = Cleaned(
            precision_of(adjust_problem(problem, values)), np.zeros(0, dtype=np.int64)
        )
    else:
        cleaned = without_outliers(problem, values, options.limit_w, progress=progress)
    progress("variance components")
    no_images = options.mode == "fast_at"
    kinds = [k for k in options.reweight if k != "none" and not (k == IMAGE and no_images)]
    again = reweight_block(cleaned.result.problem, cleaned.result.values, kinds)
    return AdjustedBlock(
        inputs,
        control,
        again.precision,
        again.factors,
        cleaned.rejected,
        cleaned.control,
        cleaned.result.iterations,
    )


def _of_middle_rows(inputs: BlockInputs, control: Control, readout_s: float) -> ImageBlock:
    """Return the block with pixels of the exposure of the middle row.

    First values of the points are good enough to adjust by, and the adjusted points to correct by.
    """
    motion = motion_of_images(inputs)
    problem, values = set_up(inputs, control)
    block = without_readout(problem, values, motion, readout_s)
    if inputs.file.adjustment.mode == "direct":
        return block
    cleaned = without_outliers(*set_up(replace(inputs, block=block), control))
    return without_readout(problem, cleaned.result.values, motion, readout_s)


def _intersect_points(
    inputs: BlockInputs, control: Control, problem: Problem, values: Unknowns, progress: Progress
) -> AdjustedBlock:
    """Intersect all points from poses that are held."""
    options, block = inputs.file.adjustment, problem.block
    if not (oriented := block.oriented).all():
        name = block.images[int(np.argmin(oriented))]
        raise DataError(
            f"mode direct: image {name}, and {int((~oriented).sum()) - 1} more, have no aerial"
            " control to be held; leave them out by images.skip, or take mode iso"
        )
    progress(f"intersecting {len(block.points)} points from {len(block.images)} poses")
    precision, rejected = intersected_points(
        problem, values, options.limit_w, options.keep_all, progress
    )
    return AdjustedBlock(inputs, control, precision, {}, rejected, (), precision.result.iterations)


def set_up(
    inputs: BlockInputs, control: Control, points: Sequence[ObservationGroup] | None = None
) -> tuple[Problem, Unknowns]:
    """Return all observations of a block, and first values of its unknowns.

    Parameters
    ----------
    inputs : BlockInputs
        The block.
    control : Control
        Its aerial control.
    points : sequence of ObservationGroup, optional
        Its ground control; by default all of it.

    Returns
    -------
    problem : Problem
        Image observations, aerial, ground and kinematic control, calibrations.
    values : Unknowns
        First values.
    """
    block = inputs.block
    points = control_points(block.control) if points is None else points
    groups, blocks = groups_of(inputs, control, points)
    values = replace(first_values(block), blocks=blocks)
    if (vehicle := inputs.vehicle) is not None:  # one image alone sees each place of the target
        values.point[vehicle.rows_in(block)[1]] = vehicle.exposures.position_m
    return problem_of(block, groups, blocks), values


def groups_of(
    inputs: BlockInputs, control: Control, points: Sequence[ObservationGroup]
) -> tuple[list[ObservationGroup], dict[Key, Array]]:
    """Return all observations of a block but those of images.

    Parameters
    ----------
    inputs : BlockInputs
        The block.
    control : Control
        Its aerial control.
    points : sequence of ObservationGroup
        Its ground control.

    Returns
    -------
    groups : list of ObservationGroup
        The observations.
    blocks : dict
        First values of the parameters that they share.
    """
    moving, blocks = vehicle_control(inputs, control.blocks)
    return [*control.groups, *points, *inputs.further, *moving], control.blocks | blocks


def ground_groups(problem: Problem) -> list[PointObservation]:
    """Return the ground control of a problem with the variances that were stated.

    Parameters
    ----------
    problem : Problem
        The observations.

    Returns
    -------
    list of PointObservation
        One a point; those that were rejected are not there.
    """
    return [group for group in problem.stated_groups if isinstance(group, PointObservation)]
