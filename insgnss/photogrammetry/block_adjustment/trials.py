"""What explains observations that contradict each other: each remedy is tried, the best is named.

A group whose component lies beyond its bounds says that something is wrong and not what. The block
is adjusted once more with each unknown that the block file leaves out: a delay of the exposures, a
lever arm, a bore-sight, a shift between ground and aerial control (another CRS, geoid or datum),
a readout time of a rolling shutter, of a vehicle a delay of its clock, the lever arm of its target,
a shift, and the interior orientation. An unknown explains the contradiction where the cost falls
by more than chance (99.99 % of chi-square) and by a third at least of what is too much. Where all
rays of a ground point were rejected they take part in each trial. A block that agrees is tried as
well: bore-sight and camera constant hide most of a lever arm that is 20 cm wrong.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from ...base.errors import DataError
from ...base.quantiles import chi_square_quantile
from ...flight.config.block_file import BlockFile
from ...records.block import Array
from ...report.rules.wording import screen_unit
from ..adjust.adjustment import Adjusted, adjust_problem
from ..adjust.aerial import BORESIGHT, CAMERA_LEVER_ARM, EXPOSURE_DELAY, AerialControl
from ..adjust.groups import ObservationGroup
from ..adjust.kinematic import VEHICLE_CLOCK
from ..adjust.normals import Problem, cofactors_of, problem_of
from ..adjust.outliers import without_outliers
from ..adjust.precision import image_components
from ..adjust.shutter import readout_gain
from ..adjust.unknowns import CAMERA, POSE, Key, Unknowns
from ..adjust.variance_components import with_factors
from .aerial.control import control_of, motion_is_known, motion_of_images
from .inputs import USUAL_FREE, BlockInputs, with_usual_free
from .mode import CAMERA_HELD
from .parameters import (
    MOUNTING_PARAMETERS,
    PARAMETERS,
    SIGNIFICANT_SIGMAS,
    UNSTATED_ARM_M,
    VEHICLE_PARAMETERS,
    BlockParameter,
)
from .residuals.ground_shift import CONTROL_SHIFT, ShiftedPoint
from .solve import AdjustedBlock, ground_groups, groups_of
from .solve import solve_block as adjusted_block
from .vehicle.rays import moved_in_time
from .vehicle.verdict import remedy as what_to_do

INTERIOR_ORIENTATION = "interior orientation"
GAIN_CHANCE = 0.9999  # of chi-square that the fall of the cost must exceed: 1 in 10 000 by chance
GAIN_SHARE = 1.0 / 3.0  # of the cost that is too much, which an explanation takes away (chosen)
RIVAL_GAIN = 0.8  # of the gain of the best explanation, from which on another one is a rival
CONVERGED_VARIANCE = 9.0  # of a group that is no image's: beyond three sigmas the trial is wrong
FEWEST_LINES, FEWEST_OF_LINE = 3, 3  # of two lines none is the wrong one; two images are no line
LEAST_SIGMA_M = 1e-4  # of a projection centre: of held ones no share of zero is taken
LONGEST_ARM_M = 5.0  # from camera to antenna (m), of crewed aircraft; what is longer is no arm
COVERED_SIGMAS = 4.0  # of a projection centre, within which an error is covered by them
DRIVING_MPS = 0.1  # of a vehicle (median) whose clock its places show (chosen)
OTHER_DATUM = "check CRS, heights (geoid or ellipsoid), antenna heights of base and drone"
OF_TIE_POINTS = "adjust the tie points in mode iso, and take the camera.toml that it writes"


@dataclass(frozen=True, eq=False)
class Trial:
    """One remedy and what it did.

    Parameters
    ----------
    name : str
        The unknown that was added.
    gain : float
        By how much the cost fell.
    value, sigma : ndarray
        Its values and standard deviations, in `unit`.
    unit : str
        m, rad, s or px.
    explains : bool
        Whether it explains what was too much.
    remedy : str
        What to do about it.
    moves_sigmas : float
        By how many of its standard deviations it moves a projection centre, of that and the axis
        where it does most.
    in_place_of_arm : Trial, optional
        The same in the place of a lever arm that nobody states; its gain is that over neither of
        both, and it `explains` where it differs from zero.
    """

    name: str
    gain: float
    value: Array
    sigma: Array
    unit: str
    explains: bool
    remedy: str
    moves_sigmas: float = 0.0
    in_place_of_arm: "Trial | None" = None

    @property
    def unknowns(self) -> int:
        """How many unknowns were added."""
        return self.value.size

    @property
    def shown(self) -> str:
        """Its values as people read them."""
        factor, unit = (1.0, "px") if self.unit == "px" else screen_unit(self.unit)
        values = " / ".join(_plain(factor * v) for v in self.value[:3])
        sigma = " / ".join(f"{factor * v:.2g}" for v in self.sigma[:3])
        return f"{values} {unit} (sigma {sigma})"


def _plain(value: float) -> str:
    """Return a number in three digits at least, without a power of ten."""
    return f"{value:+.3g}" if abs(value) < 999.5 else f"{value:+.0f}"


def explains(
    gain: float, unknowns: int, excess: float, share: float = GAIN_SHARE, candidates: int = 1
) -> bool:
    """Tell whether a gain, the best of some, is no chance, and a share of what is too much.

    Parameters
    ----------
    gain, excess : float
        By how much the cost fell, and by how much it is larger than its expectation.
    unknowns, candidates : int
        How many unknowns were added, and of how many such trials it is the best.
    share : float
        Of the excess, which an explanation takes away at least.
    """
    least = chi_square_quantile(unknowns, (1.0 - GAIN_CHANCE) / candidates)
    return bool(gain > max(least, share * excess))


def trials(
    solved: AdjustedBlock, excess: float, progress: Callable[[str], None], everything: bool = True
) -> tuple[Trial, ...]:
    """Try what the block file leaves out.

    Parameters
    ----------
    solved : AdjustedBlock
        The adjusted block.
    excess : float
        By how much the cost is larger than its expectation.
    progress : callable
        Is called with the name of each step.
    everything : bool
        Whether a bore-sight without standard deviation is tried as well, which is estimated anyway.

    Returns
    -------
    tuple of Trial
        Those that could be adjusted, the largest gain beyond its unknowns first; of the shift of
        one line, which is the worst of many, beyond what their number gains by chance as well.
    """
    done = []
    if solved.direct:
        return ()
    for remedy in _remedies(solved.inputs):
        if remedy.key[0] == BORESIGHT and not everything:
            continue
        progress(f"trying: {remedy.name}")
        try:
            done.append(_trial_of(solved, remedy, excess))
        except DataError:
            continue  # it is not determined, or impossible, so that it explains nothing
    if (readout := _readout(solved, excess, progress)) is not None:
        done.append(readout)
    chosen = {}
    if (of_line := _shifted_line(solved, excess)) is not None:
        done.append(of_line)
        lines = sum(_is_line(group) for group in solved.result.problem.stated_groups)
        chosen = {of_line.name: 2.0 * np.log(lines)}  # what the best of as many gains by chance
    done.sort(key=lambda trial: trial.unknowns + chosen.get(trial.name, 0.0) - trial.gain)
    # a delay, one unknown, stands before a lever arm along the track that gains little more
    single = [t for t in done if t.unknowns == 1 and t.gain > RIVAL_GAIN * done[0].gain]
    rivals, absorbed = [t for t in done if t.gain > RIVAL_GAIN * done[0].gain], gain_of_arm(solved)
    # what leaves nothing of a lever arm that nobody states explains more than what is beside it
    whole = [
        t
        for t in rivals
        if t.in_place_of_arm is not None
        and absorbed > COVERED_SIGMAS**2
        and t.in_place_of_arm.gain > t.gain + absorbed - COVERED_SIGMAS**2
    ]
    return tuple(dict.fromkeys([*whole, *single, *done]))


def _readout(solved: AdjustedBlock, excess: float, progress: Callable[[str], None]) -> Trial | None:
    """Return the readout time of a rolling shutter beside the unknowns of the adjustment."""
    if solved.inputs.file.camera.readout_s is not None:
        return None
    progress("trying: readout time of the shutter")
    options = solved.inputs.file.adjustment

    def cleaned(problem: Problem, values: Unknowns) -> Adjusted:
        return without_outliers(problem, values, options.limit_w).result

    motion = motion_of_images(solved.inputs)
    estimate = readout_gain(solved.result, motion, None if options.keep_all else cleaned)
    if estimate is None:
        return None
    value, sigma, gain, moved = estimate
    return Trial(
        "readout time of the shutter",
        gain,
        np.array([value]),
        np.array([sigma]),
        "s",
        explains(gain, 1, excess),
        f"state it, camera.readout_s = {value:.4g} (--readout), if the shutter is a rolling one",
        moved_sigmas(solved, moved),
    )


def moved_sigmas(solved: AdjustedBlock, moved_m: Array) -> float:
    """Return by how many of their standard deviations projection centres move at most.

    Parameters
    ----------
    solved : AdjustedBlock
        The adjusted block.
    moved_m : ndarray, (n, 3)
        By how much they move, m.
    """
    sigma_m = np.sqrt(np.diagonal(solved.precision.pose_cov[:, :3, :3], axis1=1, axis2=2))
    return float((np.abs(moved_m) / np.maximum(sigma_m, LEAST_SIGMA_M)).max())


def _shifted_line(solved: AdjustedBlock, excess: float) -> Trial | None:
    """Return the shift of the flight line that fits the rest worst, such as of a wrong ambiguity.

    With the residuals e of a line's poses, their weight W, design J and the cofactors Q of its
    unknowns, a shift of all its positions, H s, has

        N = H^T (W - W J Q J^T W) H,    s = N^-1 H^T W e,    gain = s^T N s,    dx = -Q J^T W H s

    as an adjustment with the shift as a further unknown has, without another adjustment.
    """
    best: Trial | None = None
    problem = solved.result.problem
    pairs = zip(problem.groups, problem.stated_groups, strict=True)
    groups = [group for group, stated in pairs if _is_line(stated)]
    if len(groups) < FEWEST_LINES or solved.inputs.file.aerial_control.shift_sigma_m is not None:
        return None
    block = problem.block
    for group in groups:
        e, J = group.linearised(solved.result.values)
        images = [row for name, row in group.keys if name == POSE]
        size = e.size // len(images)
        H = np.tile(np.eye(size)[:, :3], (len(images), 1))
        W, Q = group.weight, solved.precision.cov(*group.keys)
        JWH = J.T @ (W @ H)
        N = H.T @ W @ H - JWH.T @ Q @ JWH
        if not np.linalg.eigvalsh(N)[0] > 0.0:
            continue
        shift = np.asarray(np.linalg.solve(N, H.T @ (W @ e)), dtype=np.float64)
        gain = float(shift @ N @ shift)
        if best is not None and gain <= best.gain:
            continue
        moved = np.abs(Q @ JWH @ shift) / np.sqrt(np.diagonal(Q))
        of_positions = moved[: 6 * len(images)].reshape(-1, 6)[:, :3]
        first, last = block.images[images[0]], block.images[images[-1]]
        best = Trial(
            f"shift of the flight line from {first} to {last}",
            gain,
            shift,
            np.asarray(np.sqrt(np.diagonal(np.linalg.inv(N))), dtype=np.float64),
            "m",
            explains(gain, 3, excess, candidates=len(groups)),
            "look for a wrong ambiguity or another base there; --shift-sigma (shift_sigma_m)"
            " estimates a shift of each line",
            float(of_positions.max()),
        )
    return best


def _is_line(group: ObservationGroup) -> bool:
    """Tell whether a group is absolute control of a flight line of several images."""
    return isinstance(group, AerialControl) and len(group.images) >= FEWEST_OF_LINE


def converging(inputs: BlockInputs, progress: Callable[[str], None]) -> Trial | None:
    """Try what makes an adjustment converge that does not as the block file has it.

    Parameters
    ----------
    inputs : BlockInputs
        The block.
    progress : callable
        Is called with the name of each step.

    Returns
    -------
    Trial or None
        The remedy with the smallest residuals; None where none converges.
    """
    best: tuple[float, Trial] | None = None
    for remedy in _remedies(inputs):
        key = remedy.key
        if key == CONTROL_SHIFT:
            continue
        progress(f"trying: {remedy.name}")
        block = with_usual_free(inputs.block) if key[0] == CAMERA else inputs.block
        wider = replace(inputs, file=remedy.file, block=block)
        try:
            again = adjusted_block(wider, lambda _: None)
        except DataError:
            continue
        of_images = image_components(again.result.problem.block)
        held = (c for c in again.components if c.name not in of_images)
        if any(c.variance > CONVERGED_VARIANCE for c in held):
            continue  # it converges, and to nothing
        if best is not None and best[0] <= again.result.cost:
            continue
        value = _change(again.result, key, inputs.file, block.cameras[0].interior)
        sigma = np.sqrt(np.diagonal(again.precision.cov(key)))
        advice = remedy.advice(inputs, value, sigma)
        trial = Trial(remedy.name, np.inf, value, sigma, remedy.unit, True, advice)
        best = again.result.cost, trial
    return None if best is None else best[1]


@dataclass(frozen=True)
class _LeftOut:
    """An unknown that the block file leaves out.

    name, unit : as of `Trial`.
    key : the block of unknowns.
    file : a block file that asks for it.
    remedy : what to do where it is found.
    """

    name: str
    unit: str
    key: Key
    file: BlockFile
    remedy: str

    def advice(self, inputs: BlockInputs, value: Array, sigma: Array) -> str:
        """Return what to do about a value of it."""
        return what_to_do(inputs.vehicle, self.key, value, sigma) or self.remedy


def _remedies(inputs: BlockInputs) -> Iterator[_LeftOut]:
    file, mode, vehicle = inputs.file, inputs.file.adjustment.mode, inputs.vehicle
    parameters: list[BlockParameter] = []
    if inputs.eo is not None and mode != "indirect":
        control = file.aerial_control
        possible = {
            CAMERA_LEVER_ARM: True,
            BORESIGHT: control.absolute_attitudes,
            EXPOSURE_DELAY: motion_is_known(inputs.eo, control),
        }
        parameters += [one for one in MOUNTING_PARAMETERS if possible[one.name]]
        if len(inputs.block.control) > 1:
            yield _LeftOut(CONTROL_SHIFT[0], "m", CONTROL_SHIFT, file, OTHER_DATUM)
    if vehicle is not None:
        drives = np.median(np.linalg.norm(vehicle.exposures.velocity, axis=1)) > DRIVING_MPS
        parameters += [
            one for one in VEHICLE_PARAMETERS if one.loose and (drives or one.name != VEHICLE_CLOCK)
        ]
    for one in parameters:
        if one.left_out(file):
            wider, advice = one.estimated_in(file), f"estimate it with {one.option}"
            yield _LeftOut(one.error or one.name, one.unit, one.key, wider, advice)
    if any(not set(USUAL_FREE) <= set(camera.free) for camera in inputs.block.cameras):
        advice = OF_TIE_POINTS if mode in CAMERA_HELD else "estimate it with camera.free"
        yield _LeftOut(INTERIOR_ORIENTATION, "px", (CAMERA, 0), file, advice)


def _change(result: Adjusted, key: Key, file: BlockFile, interior: Array) -> Array:
    """Return how an unknown differs from its first value, that of a camera from another one."""
    if key[0] == CAMERA:
        columns = result.problem.layout.columns
        return np.asarray(result.values.interior[key[1], columns] - interior[columns])
    value = result.values.blocks[key]
    return value if key == CONTROL_SHIFT else PARAMETERS[key[0]].change(value, file)


def _trial_of(solved: AdjustedBlock, remedy: _LeftOut, excess: float) -> Trial:
    """Estimate what a remedy frees from the solution on, and judge what the rest gains by it."""
    key, inputs, result = remedy.key, solved.inputs, solved.result
    vehicle, began, block = inputs.vehicle, 0.0, result.problem.block
    alone = _without_rays(result.problem)
    if vehicle is not None and key == (VEHICLE_CLOCK, 0) and alone:  # too far off to be linear
        began, vehicle = moved_in_time(vehicle, block, result.values)
    wider = replace(inputs, file=remedy.file, vehicle=vehicle, block=block)
    points = ground_groups(result.problem)
    same = wider.file.aerial_control is inputs.file.aerial_control
    groups, first = groups_of(wider, solved.control if same else control_of(wider), points)
    blocks = {k: result.values.blocks.get(k, v) for k, v in first.items()}
    if key == CONTROL_SHIFT:
        groups = [*(g for g in groups if g not in points), *map(ShiftedPoint, points)]
        blocks[CONTROL_SHIFT] = np.zeros(3)
    if key[0] == CAMERA:
        block = with_usual_free(block)
    problem = problem_of(block, groups, blocks)
    of_images = image_components(block)  # which have their final variances already
    factors = {name: one for name, one in solved.factors.items() if name not in of_images}
    problem, values = with_factors(problem, factors), replace(result.values, blocks=blocks)
    if alone:  # rays that were rejected for its sake take part again
        again = without_outliers(problem, values).result
    else:
        again = adjust_problem(problem.with_active_of(result.problem), values)
    gain = result.cost - again.cost
    value = _change(again, key, inputs.file, result.values.interior[0]) + began
    arm = _unstated_arm(again, remedy)
    columns = [again.problem.layout.of(k)[0] for k in (key, *arm)]
    joint = cofactors_of(again.problem, again.values, np.concatenate(columns))
    cov = joint[: value.size, : value.size]
    sigma = np.sqrt(np.diagonal(cov))
    if alone:
        gain = float(value @ np.linalg.solve(cov, value))
        if key[0] == CAMERA_LEVER_ARM:
            gain -= gain_of_arm(solved)  # which the solution has already
        excess = 0.0 if len(_without_rays(again.problem)) < GAIN_SHARE * len(alone) else np.inf
    if key[0] == CAMERA_LEVER_ARM and np.linalg.norm(value) > LONGEST_ARM_M:
        raise DataError(f"no lever arm is longer than {LONGEST_ARM_M:g} m")
    trial = Trial(
        remedy.name,
        float(gain),
        value,
        sigma,
        remedy.unit,
        explains(gain, value.size, excess),
        remedy.advice(inputs, value, sigma),
        moved_sigmas(solved, again.values.position - result.values.position),
    )
    if not arm:
        return trial
    instead = _without_arm(trial, again.values.blocks[arm[0]], joint)
    return replace(trial, in_place_of_arm=replace(instead, gain=instead.gain + gain_of_arm(solved)))


def gain_of_arm(solved: AdjustedBlock) -> float:
    """Return by how much a lever arm that nobody states lowers the cost; zero where it is stated.

    Parameters
    ----------
    solved : AdjustedBlock
        The adjusted block.
    """
    arm: Key = (CAMERA_LEVER_ARM, 0)
    if solved.inputs.file.aerial_control.lever_arm_sigma_m != UNSTATED_ARM_M:
        return 0.0
    arm_m = solved.result.values.blocks[arm]
    return float(arm_m @ np.linalg.solve(solved.precision.cov(arm), arm_m))


def _unstated_arm(again: Adjusted, remedy: _LeftOut) -> tuple[Key, ...]:
    """Return the lever arm that nobody states, beside another unknown; empty without."""
    unstated = remedy.file.aerial_control.lever_arm_sigma_m == UNSTATED_ARM_M
    return tuple(k for k in again.values.blocks if unstated and k[0] == CAMERA_LEVER_ARM)


def _without_arm(trial: Trial, arm_m: Array, joint: Array) -> Trial:
    """Return what a trial is with the lever arm held at zero, which was estimated beside it.

    With the cofactors Q of the unknown x and of the arm a,

        x_0 = x - Q_xa Q_aa^-1 a,    Q_0 = Q_xx - Q_xa Q_aa^-1 Q_ax,    g_0 = g - a^T Q_aa^-1 a

    as the adjustment without arm has, without another adjustment.
    """
    n = trial.value.size
    Q_xa, Q_aa = joint[:n, n:], joint[n:, n:]
    gain = trial.gain - float(arm_m @ np.linalg.solve(Q_aa, arm_m))
    value = trial.value - Q_xa @ np.linalg.solve(Q_aa, arm_m)
    cov = joint[:n, :n] - Q_xa @ np.linalg.solve(Q_aa, Q_xa.T)
    sigma = np.sqrt(np.diagonal(cov))
    shown = bool((np.abs(value) > SIGNIFICANT_SIGMAS * sigma).any())
    return replace(trial, gain=gain, value=value, sigma=sigma, explains=shown)


def _without_rays(problem: Problem) -> list[int]:
    """Return the object points with ground control of which no image observation takes part."""
    return [int(row) for row in np.flatnonzero(problem.observed & (problem.ray_count == 0))]
