"""The whole job of `insgnss calibrate mounting`: process, read, adjust, process again, judge.

The flight is processed with a wide a-priori sigma of the antenna's lever arm, the mounting adjusted
to the poses of the block, and the flight processed once more with what came out, until corrections
are small beside their standard deviations: what is written was tried.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from ...base.errors import InputError, UsageError
from ...base.inputs import read_text, sha256
from ...base.tables import parse_toml
from ...base.wording import relative
from ...flight.config.flight_file import Flight
from ...flight.processing.input_files import input_files
from ...flight.processing.pipeline import ProcessResult, process
from ...geodesy.frames import TangentPlane
from ...geodesy.rotation import (
    nearest_rotation,
    rotation_from_vector,
    vector_from_rotation,
)
from ...io.formats.orientation.mounting_file import DELAY, VECTORS
from ...records.cameras.mounting import Mounting
from ..comparison.hints import Hints
from .block_errors import FIRST_ATTITUDE, FIRST_POSITION
from .block_poses import block_poses, common_images
from .judgement import (
    NAMES_OF_GROUPS,
    USEFUL,
    MountingComponent,
    components,
    linear_functions,
    misread_boresight,
)
from .options import Assumptions
from .plausibility import FlightPath as FlownPath
from .plausibility import gross_errors, refuse_frame, refuse_implausible
from .poses import compared_with, read_camera_poses, refuse_distant
from .products import files_of
from .records import CameraPoses, CovariantPoses, Rows, Stated
from .solution import AdjustedMounting, solve

MOST_RUNS = 3  # of processing the flight with the corrected mounting: the second changes little
# corrections over sigmas, with which the flight need not be processed again
SETTLED_CORRECTIONS = 0.3
TRAJECTORY_HZ = 20.0  # of the trajectory, by which a camera delay moves along the path
FIXED_SIGMA = 1e-6  # by which values that are not determined are held, in their units


@dataclass(frozen=True, eq=False)
class MountingResult:
    """A calibrated mounting.

    Parameters
    ----------
    solved : AdjustedMounting
        The last solution.
    stated : Stated
        What the flight file has.
    components : tuple of MountingComponent
        A verdict each.
    mounting : Mounting
        What was found, with the flight file's values where nothing was determined.
    delay_s : float
        Delay from event to mid-exposure, s.
    corrections : tuple of float
        Largest correction over its sigma in each round.
    inputs : tuple of (str, str)
        Name and SHA-256 of the files.
    notes : tuple of str
        What a reader should know.
    input_files : tuple of Path
        The files.
    """

    solved: AdjustedMounting
    stated: Stated
    components: tuple[MountingComponent, ...]
    mounting: Mounting
    delay_s: float
    corrections: tuple[float, ...]
    inputs: tuple[tuple[str, str], ...]
    notes: tuple[str, ...]
    input_files: tuple[Path, ...]

    @property
    def headline(self) -> str:
        """What is to be known first."""
        judged = self.components
        determined = [c for c in judged if c.determined]
        summary = f"{len(determined)} of {len(judged)} components determined by"
        summary += f" {self.solved.rows.size} images"
        against = list(
            dict.fromkeys(NAMES_OF_GROUPS.get(c.group, c.name) for c in judged if c.against)
        )
        if against:
            verb = "contradicts" if len(against) == 1 else "contradict"
            summary = f"the flight file's {_listed(against)} {verb} the poses; {summary}"
        if (times := self.solved.enlarged) > 1.0:
            summary = (
                f"the flight's errors are {times:.1f} times as large as its covariances say, by"
                f" which all standard deviations are multiplied; {summary}"
            )
        return summary


def _listed(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def calibrate_mounting(
    flight: Flight,
    poses: Path,
    assumptions: Assumptions | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> MountingResult:
    """Calibrate lever arms, bore-sight and camera delay of a flight by poses of its block.

    Parameters
    ----------
    flight : Flight
        The flight file.
    poses : Path
        Poses of an adjusted block: a file or directory of any readable program.
    assumptions : Assumptions, optional
        What is known before; by default nothing but the frame of a georeferenced block.
    progress : callable
        Is called with the name of each step.

    Returns
    -------
    MountingResult
        Values and verdicts.

    Raises
    ------
    InputError
        The poses are not of this flight, or not as somebody thinks.
    DataError
        The flight or the poses do not support the answer.
    """
    if flight.camera is None:
        raise InputError.in_file(
            flight.path, "no [camera]; a mounting needs the events of the exposures"
        )
    assumptions = assumptions or Assumptions()
    # before the flight is processed, which takes minutes
    hints = Hints(crs=assumptions.crs, geoid=assumptions.geoid, shift=assumptions.shift)
    read = read_camera_poses(poses, hints)
    stated = _stated(flight)
    mounting, delay = flight.mounting, stated.delay_s
    corrections, notes = list[float](), list[str]()
    placed: CameraPoses | None = None
    for number in range(MOST_RUNS):
        flight_poses, result = _processed(flight, mounting, delay, assumptions, progress)
        if placed is None:
            placed = block_poses(read, flight_poses.eo)
        if assumptions.frame == "shift" and not placed.georeferenced:
            raise UsageError(
                f"--frame shift: {placed.source} stands in axes of its own, with a scale and a"
                " turn that are not known; leave the option out"
            )
        block, rows = common_images(placed, flight_poses.eo)
        if number == 0:
            progress("are these poses of this flight")
            notes += _refuse_other_poses(block, hints, flight_poses, rows, result, flight)
        progress("adjusting the mounting")
        solved = solve(block, flight_poses, rows, assumptions)
        good, gross = gross_errors(solved)
        if gross:
            block, rows = block.taken(np.flatnonzero(good)), rows[good]
            solved = solve(block, flight_poses, rows, assumptions)
        refuse_frame(solved)
        judged = components(solved, stated)
        new, new_delay, judged = determined_mounting(solved, stated, judged)
        corrections.append(_largest(solved, judged, new, new_delay))
        mounting, delay = new, new_delay
        if corrections[-1] < SETTLED_CORRECTIONS:
            break
    assert placed is not None
    failing = len(placed.images) - block.position.shape[0] - len(gross)
    notes += [*gross, *block.notes]
    if failing:
        notes.append(
            f"{failing} of {len(placed.images)} poses belong to images that are not in the flight"
        )
    if (missing := len(flight_poses.eo) - block.position.shape[0] - len(gross)) > 0:
        notes.append(
            f"{missing} of {len(flight_poses.eo)} images of the flight have no pose in the block"
        )
    if (advice := misread_boresight(stated, judged, mounting.boresight)) is not None:
        notes.insert(0, advice)
    if any(c.held for c in judged):
        notes.append(
            "components that are not determined keep the flight file's value; the others are"
            " estimated with these values"
        )
    notes.append(_statistics(solved))
    notes.append(
        "after processing the flight again with this mounting, the remaining corrections"
        f" are {corrections[-1]:.2f} sigma at most"
        if len(corrections) > 1
        else "the flight file's mounting is right within its standard deviations"
    )
    return MountingResult(
        solved,
        stated,
        judged,
        mounting,
        delay,
        tuple(corrections),
        _inputs(flight, result, poses),
        tuple(notes),
        (*input_files(flight), poses),
    )


def _refuse_other_poses(
    block: CameraPoses,
    hints: Hints,
    flight: CovariantPoses,
    rows: Rows,
    result: ProcessResult,
    file: Flight,
) -> tuple[str, ...]:
    """Refuse poses of another place, of other images, or in another reading; return notes."""
    eo = flight.eo
    placed = eo.position_m[rows], TangentPlane(*eo.origin), str(file.path)
    distant = refuse_distant(block, hints, *placed)
    compared = partial(compared_with, block, hints, *placed)
    refuse_implausible(block, flight, rows, _path(result, flight), compared)
    return distant


def _stated(flight: Flight) -> Stated:
    """Return what the flight file states of the mounting, and which keys."""
    assert flight.camera is not None
    mounting, delay = flight.mounting, flight.camera.time_offset_s
    keys = {key for source in flight.mounting_files for key in source.keys}
    if flight.path.is_file():
        tables = parse_toml(flight.path, read_text(flight.path, "utf-8-sig"))
        keys |= set(tables.get("mounting", {})) | set(tables.get("camera", {}))
    else:  # made in Python: what is not the default
        none = Mounting()
        keys |= {key for key in VECTORS if getattr(mounting, key).any()}
        keys |= set() if np.array_equal(mounting.boresight, none.boresight) else {"boresight"}
        keys |= {DELAY} if delay else set()
    if "boresight_deg" in keys:
        keys.add("boresight")
    if DELAY in keys:
        keys.add("delay")
    return Stated(mounting, delay, frozenset(keys))


def _processed(
    flight: Flight,
    mounting: Mounting,
    delay: float,
    assumptions: Assumptions,
    progress: Callable[[str], None],
) -> tuple[CovariantPoses, ProcessResult]:
    """Process the flight with a mounting, the lever arm of its antenna left open."""
    assert flight.camera is not None
    sigma = assumptions.lever_arm_sigma_m
    changed = replace(
        flight,
        mounting=mounting,
        camera=replace(flight.camera, time_offset_s=delay, further=()),  # of a rig the first
        filter=replace(flight.filter, lever_arm=True, lever_arm_sigma_m=sigma),
        output=replace(flight.output, strip_covariance=True, trajectory_hz=TRAJECTORY_HZ),
    )
    result = process(changed, None, progress, write=False)
    assert result.eo is not None
    assert result.common is not None
    return CovariantPoses(result.eo, result.strips, result.common, mounting, delay), result


def _path(result: ProcessResult, flight_poses: CovariantPoses) -> FlownPath:
    """Return the poses of the camera on the output grid."""
    t = result.trajectory
    plane = TangentPlane(*(float(x) for x in flight_poses.eo.origin))
    C_mb = plane.C_mn(t.lat, t.lon) @ t.C_nb
    X = plane.position_from_geodetic(t.lat, t.lon, t.height)
    return FlownPath(
        t.time, X + C_mb @ flight_poses.mounting.camera_lever_b, C_mb @ flight_poses.mounting.C_cb.T
    )


def determined_mounting(
    solved: AdjustedMounting, stated: Stated, judged: tuple[MountingComponent, ...]
) -> tuple[Mounting, float, tuple[MountingComponent, ...]]:
    """Return the mounting that was found.

    What is not determined is held at the flight file's value where that may be right
    (`MountingComponent.held`), and the rest follows by its correlations.

    Parameters
    ----------
    solved : AdjustedMounting
        The adjusted mounting.
    stated : Stated
        The flight file's.
    judged : tuple of MountingComponent
        The verdicts.

    Returns
    -------
    mounting : Mounting
        Lever arms and bore-sight.
    delay_s : float
        The delay.
    judged : tuple of MountingComponent
        The verdicts with these values.
    """
    names, J, values, before = linear_functions(solved, stated)
    standing = {(c.group, c.axis) for c in judged if c.held and c.group != "shift"}
    held = [k for k, (group, axis, _) in enumerate(names) if (group, axis) in standing]
    change = np.zeros(len(values))
    if held:
        dx, _ = solved.conditioned(J[held], before[held] - values[held], FIXED_SIGMA)
        change = J @ dx
    mixed = values + change
    mixed[held] = before[held]
    of = {
        group: np.array([mixed[k] for k, name in enumerate(names) if name[0] == group])
        for group in USEFUL
        if group != "shift"
    }
    # C_cb C_cb'^T = exp([beta x])
    C_cb = rotation_from_vector(of["boresight"]).T @ stated.mounting.C_cb
    T = stated.mounting.camera_from_body
    mounting = replace(
        stated.mounting,
        antenna_m=of["antenna_m"],
        imu_m=of["imu_m"],
        boresight=nearest_rotation(T.T @ C_cb),
    )
    value = {(group, axis): float(x) for (group, axis, _), x in zip(names, mixed, strict=True)}
    judged = tuple(replace(c, value=value[c.group, c.axis]) if c.determined else c for c in judged)
    return mounting, float(of["delay"][0]), judged


def _largest(
    solved: AdjustedMounting,
    judged: tuple[MountingComponent, ...],
    mounting: Mounting,
    delay: float,
) -> float:
    """Return the largest correction of what the flight was processed with, over its sigma."""
    sigma = {(c.group, c.axis): c.sigma for c in judged if c.determined}
    before = solved.flight.mounting
    turn = mounting.C_cb @ before.C_cb.T
    change = {
        "antenna_m": mounting.antenna_m - before.antenna_m,
        "imu_m": mounting.imu_m - before.imu_m,
        "boresight": vector_from_rotation(turn),
        "delay": np.array([delay - solved.flight.delay_s]),
    }
    ratios = [
        abs(float(change[group][axis])) / s for (group, axis), s in sigma.items() if group in change
    ]
    return max(ratios, default=0.0)


def _statistics(solved: AdjustedMounting) -> str:
    """Say how the covariances of both sides agree with the residuals."""
    factors = [float(np.sqrt(x)) for x in solved.factors.values()]
    if solved.block.cov is not None:
        return (
            f"by the residuals, standard deviations of the block's poses are {factors[0]:.2f}"
            " times the stated ones, which are multiplied by this factor"
        )
    return (
        "the block's poses have no covariances; their residuals give"
        f" {1e3 * factors[0] * FIRST_POSITION:.0f} mm and"
        f" {np.degrees(factors[1] * FIRST_ATTITUDE):.4f} deg"
    )


def _inputs(flight: Flight, result: ProcessResult, poses: Path) -> tuple[tuple[str, str], ...]:
    of_flight = (
        (str(name), str(digest)) for name, digest in result.report["inputs_sha256"].items()
    )
    files = files_of(poses)[:50]
    return (*of_flight, *((relative(file, flight.path.parent), sha256(file)) for file in files))
