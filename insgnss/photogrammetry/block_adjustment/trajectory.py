"""Images correct the trajectory: the joint adjustment of inertial samples, fixes and images.

The flight is solved again, and instead of lines with a covariance each the poses of a whole segment
are one group of the block, weighed by the inverse W of C, the covariance of all of them that the
chain of states gives (B.8). What the adjustment leaves of the group goes back to the states at all
epochs (`navigation.filter.correction`): with its residuals e, observed - computed, J and the
cofactors Q of its unknowns

    mu = -e,    V = J Q J',    lambda = -W e,    C M C = C - V                                (J.11)

so that a root of M is W times one of C - V. That root is taken column by column (Cholesky with
pivots) until what is left is below `ENOUGH` of any variance in V; what is left stays in the
covariances, which are no smaller than they should be. Camera, bore-sight and lever arm of the
camera are unknowns of the block, the antenna's lever arm, biases and clocks of the chain.

Filter, smoother and block are linearised again about the corrected flight until the next round is
expected to move no pose of an image by more than `STANDING_SIGMAS` of its standard deviation: by
what this one moved them, times the ratio of this one to the one before where that is below one.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...base.errors import DataError, InputError, UsageError
from ...base.memory import GB, available
from ...flight.config.flight_file import Flight
from ...flight.processing.orientation.poses import orient_images
from ...flight.processing.orientation.strips import PoseChain, pose_chains
from ...flight.processing.pipeline import ProcessResult, process
from ...flight.processing.recording import Recording
from ...flight.processing.segment import Segment
from ...geodesy.rotation import rotation_from_vector, vector_from_rotation
from ...navigation.filter.codes import AZ, POS
from ...navigation.filter.correction import correct_solution, smoothed_about
from ...records import ExteriorOrientation
from ...records.block import Array
from ..adjust.adjustment import Adjusted, adjust_problem, intersected_again
from ..adjust.aerial import AerialControl
from ..adjust.normals import cofactors_of, problem_of
from ..adjust.precision import explained_cofactors
from ..adjust.unknowns import Unknowns, columns_of
from ..adjust.variance_components import with_factors
from .aerial.control import control_of
from .inputs import BlockInputs
from .solve import AdjustedBlock, ground_groups, groups_of

TRAJECTORY_DIRECTORY = "trajectory"
ENOUGH = 0.02  # share of a pose's variance after the images: 1 % of its standard deviation
# standard deviations after the images (chosen): changes no figure that is shown
STANDING_SIGMAS = 0.05
Poses = tuple[Sequence[int], Array, Array]
"""Rows of the block's images, and their positions (m) and attitudes in the axes of the block."""
MOST_ROUNDS = 6  # linearisations (chosen); two or three settle an outage of 90 s
MATRICES = 14  # of all poses at once (measured): 0.8 GB of 434 images, 4 GB of 1000


def refuse_unfit(inputs: BlockInputs, flight: Flight) -> None:
    """Refuse a block that cannot correct a trajectory.

    Parameters
    ----------
    inputs : BlockInputs
        The block.
    flight : Flight
        The flight file of its orientation.

    Raises
    ------
    UsageError
        Its aerial control is not that of poses of one camera with the covariance of their flight.
    """
    control, options = inputs.file.aerial_control, inputs.file.adjustment
    images = 0 if inputs.eo is None else len(inputs.eo)
    problem = ""
    if options.mode != "iso" or not images:
        problem = (
            f'adjustment.mode = "{options.mode}"; a trajectory needs mode "iso" and the'
            " eo.json of a flight"
        )
    elif control.control != "Ap/Aa" or control.of_lines:
        problem = (
            "aerial_control.control or .lines leaves out observations of the flight; take"
            " Ap/Aa for all images"
        )
    elif control.shift_sigma_m is not None or control.drift_sigma_mps is not None:
        problem = (
            "aerial_control.shift_sigma_m or .drift_sigma_mps; the flight estimates errors of"
            " the fixes itself (gnss.gm_sigma), so leave shifts and drifts out"
        )
    elif "aerial control" in options.reweight:
        problem = (
            'adjustment.reweight has "aerial control", whose weights the flight defines;'
            " leave it out"
        )
    elif len(flight.mountings) != 1:
        problem = (
            f"{flight.path} has {len(flight.mountings)} cameras; only a flight with one camera"
            " can be adjusted so"
        )
    elif (needed := 8.0 * MATRICES * (6 * images) ** 2) > (free := available() or np.inf):
        problem = (
            f"{images} images need {needed / GB:.1f} GB for the covariance of all poses,"
            f" {free / GB:.1f} GB of memory are free; cut the flight with start_tow, end_tow"
        )
    if problem:
        raise UsageError(f"--trajectory: {problem}")


def corrected_trajectory(
    solved: AdjustedBlock,
    flight: Flight,
    out: Path | None,
    progress: Callable[[str], None],
    force: bool = False,
) -> tuple[ProcessResult, str]:
    """Process a flight with the images of its adjusted block.

    Parameters
    ----------
    solved : AdjustedBlock
        The adjusted block: first values, what was rejected, weights of the image observations.
    flight : Flight
        The flight file of its orientation.
    out : Path or None
        Directory of the products; None writes none.
    progress : callable
        Is called with the name of each step.
    force : bool
        Whether results of other measurements are overwritten.

    Returns
    -------
    ProcessResult
        The products of the flight after the images.
    str
        What the images changed, in a sentence.

    Raises
    ------
    InputError
        The block's orientation is not of this flight.
    DataError
        Flight and images do not come to one solution.
    """
    changed: list[str] = []

    def correct(flight: Flight, recording: Recording, segments: list[Segment]) -> list[Segment]:
        after = _Joint(solved, flight, recording, progress).corrected(segments)
        changed.append(_change_sentences(segments, after))
        return [replace(s, history=(*s.history, changed[0])) for s in after]

    flight = replace(flight, output=replace(flight.output, strip_covariance=True))
    result = process(flight, out, progress, out is not None, force, correct)
    return result, changed[0]


@dataclass(frozen=True, eq=False)
class _Joint:
    """A block and the flight that it corrects."""

    solved: AdjustedBlock
    flight: Flight
    recording: Recording
    progress: Callable[[str], None]

    def corrected(self, segments: list[Segment]) -> list[Segment]:
        """Return the segments after the images, linearised until they stand."""
        values = self.solved.result.values
        before, last = None, 0.0
        for number in range(1, MOST_ROUNDS + 1):
            self.progress(f"images correct the trajectory, round {number}")
            joint = _Linearised.of(self, segments, values)
            values, poses = joint.result.values, joint.poses()
            moved = self._moved(
                joint.poses(linearised_about=True) if before is None else before, poses
            )
            if moved * min(moved, last) < STANDING_SIGMAS * last or moved < STANDING_SIGMAS:
                self.progress("covariances after the images")
                return joint.moved(segments, covariances=True)
            before, last = poses, moved
            segments = [
                replace(old, solution=smoothed_about(old.solution, new.solution))
                for old, new in zip(segments, joint.moved(segments), strict=True)
            ]
        raise DataError(
            f"--trajectory: after {MOST_ROUNDS} rounds images still move poses by {moved:.2g}"
            f" standard deviations from one round to the next, limit {STANDING_SIGMAS:g};"
            " adjust.html shows which observations contradict each other; mend them, or leave"
            " --trajectory out"
        )

    def oriented(self, segments: list[Segment]) -> ExteriorOrientation:
        """Return the orientation of the block's images as the segments have it."""
        eo = orient_images(self.flight, self.recording, segments, ())
        expected = self.solved.inputs.eo
        if eo is None or expected is None or eo.images != expected.images:
            raise InputError(
                f"--trajectory {self.flight.path}: its images are not those of"
                f" {self.solved.inputs.file.aerial_control.file}; process the flight again"
            )
        return eo

    def _moved(self, before: Sequence[Poses], after: Sequence[Poses]) -> float:
        """Return by how many standard deviations poses of the block have moved, at most."""
        most = 0.0
        for (images, position, C), (_, moved_to, turned) in zip(before, after, strict=True):
            turn = vector_from_rotation(turned @ np.swapaxes(C, 1, 2))
            cov = self.solved.precision.pose_cov[list(images)]
            sigma = np.sqrt(np.diagonal(cov, axis1=1, axis2=2))
            most = max(most, float((np.abs(np.hstack([moved_to - position, turn])) / sigma).max()))
        return most


@dataclass(frozen=True, eq=False)
class _Linearised:
    """The block adjusted with the chains of the segments, and the group of each; None without."""

    chains: Sequence[PoseChain]
    measured: Sequence[NDArray[np.bool_]]
    groups: Sequence[AerialControl | None]
    result: Adjusted

    @classmethod
    def of(cls, joint: _Joint, segments: list[Segment], values: Unknowns) -> "_Linearised":
        """Adjust the block from some values on."""
        solved, eo = joint.solved, joint.oriented(segments)
        chains = pose_chains(joint.flight, joint.recording, segments, eo)
        inputs = replace(solved.inputs, eo=eo)
        control = control_of(inputs, whole=[(chain.rows, chain.cov) for chain in chains])
        points = ground_groups(solved.result.problem)
        groups, first = groups_of(inputs, control, points)
        problem = with_factors(problem_of(inputs.block, groups, first), solved.factors)
        problem = problem.with_active_of(solved.result.problem)
        blocks = {key: values.blocks.get(key, value) for key, value in first.items()}
        values = intersected_again(problem, replace(values, blocks=blocks))
        # one step: the next round linearises flight and block again
        result = adjust_problem(problem, values, np.inf)
        measured = [np.isin(chain.rows, inputs.eo_row) for chain in chains]
        of_chain = iter([group for group in control.groups if isinstance(group, AerialControl)])
        of_chains = [next(of_chain) if images.any() else None for images in measured]
        return cls(chains, measured, of_chains, result)

    def poses(self, linearised_about: bool = False) -> Sequence[Poses]:
        """Return the poses of each group after the images, or those it was linearised about."""
        poses: list[Poses] = []
        for group in self.groups:
            if group is not None:
                e = group.linearised(self.result.values)[0].reshape(-1, 6) * (not linearised_about)
                turned = rotation_from_vector(-e[:, 3:]) @ group.C_mc
                poses.append((group.images, group.position_m - e[:, :3], turned))
        return poses

    def moved(self, segments: list[Segment], covariances: bool = False) -> list[Segment]:
        """Return the segments after the images, with covariances where these are wanted."""
        after = []
        for segment, chain, images, group in zip(
            segments, self.chains, self.measured, self.groups, strict=True
        ):
            if group is None:
                after.append(segment)
                continue
            e, J = group.linearised(self.result.values)
            b = (-group.weight @ e)[:, None]
            if covariances:
                columns, taken = columns_of(self.result.problem.layout, group.keys)
                V = explained_cofactors(
                    J[:, taken], cofactors_of(self.result.problem, self.result.values, columns)
                )
                rows = np.repeat(images, 6)
                less, variance = chain.cov[np.ix_(rows, rows)] - V, np.diagonal(V).copy()
                del V  # as large as all the rest
                b = np.column_stack([b, _weighed_root(group.weight, less, variance)])
            events = chain.events[images]
            T, of_events = (
                np.zeros((segment.solution.event_epochs.size, 6, size))
                for size in (chain.derivatives.shape[2], b.shape[1])
            )
            T[events] = chain.derivatives[images]
            of_events[events] = b.reshape(-1, 6, b.shape[1])
            solution = correct_solution(
                segment.solution, T, of_events[:, :, 0], of_events[:, :, 1:]
            )
            after.append(replace(segment, solution=solution))
        return after


def _weighed_root(weight: Array, less: Array, variance: Array) -> Array:
    """Return a weight matrix times columns whose products make `less`, which is written over.

    What is left of `less` is below `ENOUGH` of the variances.
    """
    from scipy.linalg.blas import dtrmm
    from scipy.linalg.lapack import dpstrf

    scale = np.sqrt(variance)
    less /= scale[:, None]
    less /= scale
    factor, order, rank, _ = dpstrf(less.T, tol=ENOUGH, lower=1, overwrite_a=1)
    pivoted = np.take(weight * scale, order - 1, axis=1)
    root = dtrmm(1.0, factor[:rank, :rank], pivoted[:, :rank].T, trans_a=1, lower=1).T
    root += pivoted[:, rank:] @ factor[rank:, :rank]
    return np.asarray(root)


def _change_sentences(before: Sequence[Segment], after: Sequence[Segment]) -> str:
    """Say what the images have changed."""
    step = max(
        float(np.linalg.norm(b.solution.nav[:, POS] - a.solution.nav[:, POS], axis=1).max())
        for b, a in zip(before, after, strict=True)
    )
    position, heading = [], []
    for segments in (before, after):
        cov = np.concatenate([s.solution.nav_covariance(s.solution.rows) for s in segments])
        sigma = np.median(np.sqrt(np.diagonal(cov, axis1=1, axis2=2)), axis=0)
        position.append(f"{1e3 * sigma[POS].max():.1f}")
        heading.append(f"{np.degrees(sigma[AZ]):.4f}")
    return (
        f"images moved the trajectory by up to {1e3 * step:.1f} mm; median standard deviations of"
        f" positions {' -> '.join(position)} mm, of headings {' -> '.join(heading)} deg"
    )
