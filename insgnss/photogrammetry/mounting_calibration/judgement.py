"""A verdict on each component of the mounting, and what would determine those that a flight leaves.

A component is determined where its standard deviation is below that of other ways to know it: what
the flight file states, else what a ruler, a mechanic or a data sheet gives (`USEFUL`). Where it is
not, its largest correlations name what it cannot be told from, and further flight lines are tried:
the longest line of this flight is added once more, turned, slower or banked, with the covariance
that it has, and the normal equations are solved again. Only what then determines the component is
advised, with the standard deviation that it would have.

A component contradicts the flight file where both differ by more than `CONTRADICTS` standard
deviations of the difference, whatever else would determine it better.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from ...geodesy.conventions import CAMERA_SETS, angles
from ...geodesy.explain import explain, readings_of
from ...geodesy.rotation import opk_from_rotation, rotation_from_vector, vector_from_rotation
from ...records.block import Array
from ...records.cameras.mounting import ANTENNA_SIGMA_M
from ..adjust.aerial import BORESIGHT, EXPOSURE_DELAY
from .equations import BLOCK_SCALE, BLOCK_TURN, CAMERA_FIXED, TRANSLATION
from .records import Stated
from .solution import AdjustedMounting, Variant

DETERMINED, UNDETERMINED, CONTRADICTING = "determined", "not determined", "contradicts"
USEFUL = {"antenna_m": 0.02, "imu_m": 0.02, "boresight": np.radians(0.05), "delay": 1e-3}
USEFUL["shift"] = 0.02  # m: the datum of good ground control, as an antenna lever arm
NAMES_OF_GROUPS = {
    "antenna_m": "antenna lever arm",
    "imu_m": "IMU lever arm",
    "boresight": "bore-sight",
}
# sigmas of a bore-sight (rad) and a delay (s) that the flight file states without one (chosen)
STATED_BORESIGHT, STATED_DELAY_S = float(np.radians(0.02)), 5e-4
ALIKE_M, ALIKE_RAD = 0.005, float(np.radians(0.002))  # of a remedy
LEAST_LIMIT_M = 1e-3  # a flight file that knows it better is not asked for more
# sigmas off what is stated: by chance one in 16 000 and one in 80
CONTRADICTS, DOUBTFUL_SIGMAS = 4.0, 2.5
HELPS = 0.5  # of a sigma, that remains if something else were known
ONE_HEADING = 0.9  # length of the mean of unit vectors
BODY_WORDS = ("forward", "right", "down"), ("backward", "left", "up")
UNITS_OF_GROUPS = {"boresight": (np.degrees(1.0), "deg", 4), "delay": (1e3, "ms", 2)}
AS_MILLIMETRES = (1e3, "mm", 1)


def value_text(group: str, value: float) -> str:
    """Return a value of a group, m, rad or s, in the unit in which people read it."""
    factor, unit, digits = UNITS_OF_GROUPS.get(group, AS_MILLIMETRES)
    return f"{factor * value:.{digits}f} {unit}"


@dataclass(frozen=True)
class MountingComponent:
    """One component of the mounting.

    Parameters
    ----------
    group : str
        "antenna_m", "imu_m", "boresight", "delay" or "shift".
    axis : int
        Which of its components.
    name : str
        In words.
    value, stated : float
        What was found and what the flight file has; m, s; of the bore-sight the rotation about the
        axis of the camera against the flight file's, rad, and zero.
    sigma, limit : float
        Standard deviation, and up to which it counts as determined.
    verdict : str
        `DETERMINED`, `UNDETERMINED` or `CONTRADICTING`.
    why : str
        What it cannot be told from, or by how much it contradicts; empty otherwise.
    remedies : tuple of str
        What would determine it, each tried.
    against : bool
        Whether it contradicts the flight file, determined or not.
    held : bool
        Whether it is not determined and the flight file's value stands in: one that the file
        states, within `DOUBTFUL_SIGMAS` sigmas.
    """

    group: str
    axis: int
    name: str
    value: float
    stated: float
    sigma: float
    limit: float
    verdict: str
    why: str = ""
    remedies: tuple[str, ...] = ()
    against: bool = False
    held: bool = False

    @property
    def determined(self) -> bool:
        """Whether there is a value to use."""
        return self.verdict != UNDETERMINED

    @property
    def word(self) -> str:
        """The verdict."""
        return "contradicts the flight file" if self.verdict == CONTRADICTING else self.verdict

    @property
    def text(self) -> str:
        """Value, or why there is none."""
        factor, unit, digits = UNITS_OF_GROUPS.get(self.group, AS_MILLIMETRES)
        sigma = value_text(self.group, self.sigma)
        if not self.determined:
            required = self.group == "antenna_m" and self.limit < USEFUL["antenna_m"]
            whose = "mounting.antenna_sigma_m" if required else "limit"
            description = f"sigma {sigma} ({whose} {factor * self.limit:g} {unit})"
            return "; ".join([description, self.why, *self.remedies])
        value = f"{factor * self.value:+.{digits}f} +- {sigma}"
        return f"{value}; {self.why}" if self.why else value

    @property
    def sentence(self) -> str:
        """All of it."""
        return f"{self.name}, {self.word}: {self.text}"


@dataclass(frozen=True, eq=False)
class Facts:
    """How a flight moved, as far as it decides what can be told apart.

    Parameters
    ----------
    speed : tuple of float
        5 and 95 % of the speeds at exposure, m/s.
    headings : float
        Length of the mean of the unit vectors of the headings: 1 where all have one.
    tilt_deg : float
        Root mean square of the camera's tilt about its mean.
    """

    speed: tuple[float, float]
    headings: float
    tilt_deg: float


def facts_of(solved: AdjustedMounting) -> Facts:
    """Return how the flight moved.

    Parameters
    ----------
    solved : AdjustedMounting
        The adjusted mounting.

    Returns
    -------
    Facts
        Of the images that both know.
    """
    eo = solved.flight.eo
    assert eo.velocity_mps is not None
    v, C_mb = eo.velocity_mps[solved.rows], eo.C_mc[solved.rows] @ solved.flight.mounting.C_cb
    low, high = np.percentile(np.linalg.norm(v, axis=1), [5, 95])
    nose = C_mb[:, :2, 0]
    nose = nose / np.maximum(np.linalg.norm(nose, axis=1, keepdims=True), 1e-9)
    down = -C_mb[:, 2]  # the vertical in body axes
    deviation = down - down.mean(axis=0)
    return Facts(
        (float(low), float(high)),
        float(np.linalg.norm(nose.mean(axis=0))),
        float(np.degrees(np.sqrt((deviation**2).sum(axis=1).mean()))),
    )


def components(solved: AdjustedMounting, stated: Stated) -> tuple[MountingComponent, ...]:
    """Judge every component.

    Parameters
    ----------
    solved : AdjustedMounting
        The adjusted mounting.
    stated : Stated
        What the flight file says.

    Returns
    -------
    tuple of MountingComponent
        Antenna, bore-sight, delay, the IMU's lever arm, and the shift of a georeferenced block.
    """
    names, J, values, before = linear_functions(solved, stated)
    V = J @ solved.cov @ J.T
    sigma = np.sqrt(np.diagonal(V))
    facts = facts_of(solved)
    out: list[MountingComponent] = []
    undetermined: list[int] = []
    for k, (group, axis, name) in enumerate(names):
        if group not in USEFUL:
            continue
        stated_sigma = _stated_sigma(group, stated)
        limit = USEFUL[group]
        if group == "antenna_m" and stated.antenna_sigma_m is not None:
            limit = min(limit, max(stated.antenna_sigma_m, LEAST_LIMIT_M))
        verdict, why = (DETERMINED, "") if sigma[k] <= limit else (UNDETERMINED, "")
        normalised = (
            0.0
            if stated_sigma is None
            else float(abs(values[k] - before[k]) / np.hypot(sigma[k], stated_sigma))
        )
        in_file = value_text(group, before[k])
        if verdict == UNDETERMINED:
            undetermined.append(len(out))
            why = _why(names, V, k, facts)
            if normalised > DOUBTFUL_SIGMAS:
                why += (
                    f"; the flight file's {in_file} lies {normalised:.1f} sigma from what was found"
                )
        elif normalised > CONTRADICTS:
            verdict, why = CONTRADICTING, f"{in_file} there, {normalised:.0f} sigma"
        out.append(
            MountingComponent(
                group,
                axis,
                name,
                float(values[k]),
                float(before[k]),
                float(sigma[k]),
                float(limit),
                verdict,
                why,
                against=normalised > CONTRADICTS,
                held=verdict == UNDETERMINED
                and stated_sigma is not None
                and normalised <= DOUBTFUL_SIGMAS,
            )
        )
    if undetermined:
        judged = [k for k, name in enumerate(names) if name[0] in USEFUL]
        _advise(solved, J[:3], J[judged], out, undetermined)
    return tuple(out)


def _stated_sigma(group: str, stated: Stated) -> float | None:
    """Return how well the flight file knows a component; None where it says nothing of it."""
    if group not in stated.keys:
        return None
    stated_sigma = stated.antenna_sigma_m
    return {
        "antenna_m": ANTENNA_SIGMA_M if stated_sigma is None else stated_sigma,
        "imu_m": ANTENNA_SIGMA_M,
        "boresight": STATED_BORESIGHT,
        "delay": STATED_DELAY_S,
    }[group]


def linear_functions(
    solved: AdjustedMounting, stated: Stated
) -> tuple[list[tuple[str, int, str]], Array, Array, Array]:
    """Return what is judged, as linear functions of the unknowns.

    Parameters
    ----------
    solved : AdjustedMounting
        The adjusted mounting.
    stated : Stated
        The flight file's.

    Returns
    -------
    names : list of tuple
        Group, axis and words of each.
    J : ndarray, (k, u)
        Derivatives by the unknowns.
    values, before : ndarray, (k,)
        What was found, and what the flight file has; of the bore-sight the rotation between both.
    """
    antenna, imu = solved.lever_arms()
    J_arms = solved.lever_arm_derivatives()
    columns, C_cb = solved.place, solved.C_cb
    unknowns = np.eye(len(solved.cov))
    beta = vector_from_rotation(stated.mounting.C_cb @ C_cb.T)
    delay = solved.flight.delay_s + solved.values[EXPOSURE_DELAY]
    moved, shift = "translation", np.zeros(3)  # of axes of its own nobody asks for it
    if solved.block.georeferenced:
        moved = "shift"
        shift = solved.values[TRANSLATION] - solved.block.position.mean(axis=0)
    change = " against the flight file's" if "boresight" in stated.keys else ""
    about = [f"bore-sight{change} about {axis}" for axis in "xyz"]
    enu, axes = ("east", "north", "up"), [f"{'xyz'[k]} ({_direction(C_cb, k)})" for k in range(3)]
    arms = {
        key: [f"{NAMES_OF_GROUPS[key]} {axis}" for axis in axes] for key in ("antenna_m", "imu_m")
    }
    of_turn, none = [f"turn of the block about {axis}" for axis in enu], np.zeros(3)
    # group, derivatives, values, those of the flight file, words of each axis
    groups: list[tuple[str, Array, Array, Array | float, list[str]]] = [
        ("antenna_m", J_arms[:3], antenna, stated.mounting.antenna_m, arms["antenna_m"]),
        ("imu_m", J_arms[3:], imu, stated.mounting.imu_m, arms["imu_m"]),
        ("boresight", unknowns[columns[BORESIGHT]], beta, 0.0, about),
        ("delay", unknowns[columns[EXPOSURE_DELAY]], delay, stated.delay_s, ["camera delay"]),
        (moved, unknowns[columns[TRANSLATION]], shift, 0.0, [f"{moved} {axis}" for axis in enu]),
        ("turn", unknowns[columns[BLOCK_TURN]], none, 0.0, of_turn),
        ("scale", unknowns[columns[BLOCK_SCALE]], np.zeros(1), 0.0, ["scale of the block"]),
    ]
    if CAMERA_FIXED in columns:
        axes = [*"xyz", *(f"turn about {axis}" for axis in "xyz")]
        axis_names = [f"{axis} by the block's camera" for axis in axes]
        groups.append(("camera", unknowns[columns[CAMERA_FIXED]], np.zeros(6), 0.0, axis_names))
    return (
        [
            (group, axis, name)
            for group, *_, axis_names in groups
            for axis, name in enumerate(axis_names)
        ],
        np.vstack([J for _, J, *_ in groups]),
        np.hstack([values for _, _, values, *_ in groups]),
        np.hstack([np.full(len(values), before) for _, _, values, before, _ in groups]),
    )


def _direction(C_cb: Array, axis: int) -> str:
    """Return in which direction of the body an axis of the camera points."""
    d = C_cb[axis]
    k = int(np.abs(d).argmax())
    return BODY_WORDS[int(d[k] < 0.0)][k]


def _why(names: Sequence[tuple[str, int, str]], V: Array, k: int, facts: Facts) -> str:
    """Return what a component cannot be told from, with the fact that is behind it.

    That is what would reduce its sigma most if it were known: one component, or two together.
    """
    twin = {"antenna_m": "imu_m", "imu_m": "antenna_m"}.get(names[k][0])
    first = float(np.sqrt(V[k, k]))
    partners: tuple[int, ...] = ()
    for free in (
        [j for j, name in enumerate(names) if j != k and name[0] != twin],
        [j for j in range(len(names)) if j != k],
    ):
        conditions = [
            (_left(V, k, conditioned), conditioned)
            for n in (1, 2)
            for conditioned in combinations(free, n)
        ]
        alone = min(item for item in conditions if len(item[1]) == 1)
        sigma, partners = alone if alone[0] < HELPS * first else min(conditions)
        if sigma < HELPS * first:
            break
    else:
        if names[k][0] == "imu_m":
            return (
                "the poses determine the antenna's place, but hardly the IMU's: measure the"
                " latter on the aircraft"
            )
        return "the poses are not precise enough"
    reason = f"cannot be separated from {' and '.join(names[j][2] for j in partners)}"
    reason += (
        f" (were {'they' if len(partners) > 1 else 'it'} known, {value_text(names[k][0], sigma)}"
    )
    reason += f" instead of {value_text(names[k][0], first).partition(' ')[0]})"
    groups = {names[k][0], *(names[j][0] for j in partners)}
    vertical = any(w in names[i][2] for i in (k, *partners) for w in ("up", "down"))
    if groups == {names[k][0], "camera"}:
        reason += ": its principal point and camera constant move all poses alike"
    elif "delay" in groups:
        low, high = facts.speed
        reason += f": speed was {low:.1f} to {high:.1f} m/s throughout"
    elif not vertical and facts.headings > ONE_HEADING:
        reason += ": one heading"
    elif groups & {"shift", "translation", "antenna_m", "imu_m"}:
        reason += f": tilts of {facts.tilt_deg:.1f} deg rms"
    return reason


def _left(V: Array, k: int, conditions: tuple[int, ...]) -> float:
    """Return the sigma of component k if others were known."""
    columns = list(conditions)
    sigma = np.sqrt(np.diagonal(V)[columns])
    R = V[np.ix_(columns, columns)] / np.outer(sigma, sigma) + 1e-12 * np.eye(len(columns))
    c = V[k, columns] / sigma
    return float(np.sqrt(max(V[k, k] - c @ np.linalg.solve(R, c), 0.0)))


def _variants() -> tuple[Variant, ...]:
    up = np.array([0.0, 0.0, 1.0])
    half, quarter = (rotation_from_vector(a * up) for a in (np.pi, np.pi / 2.0))
    return (
        Variant("one more line at 70 % of the speed", np.eye(3), 0.7),
        Variant("one more line in the opposite direction", half, 1.0),
        Variant("one more line across", quarter, 1.0),
        Variant("one more line in the opposite direction, at 70 % of the speed", half, 0.7),
        Variant("one more line across, at 70 % of the speed", quarter, 0.7),
        Variant("one more line, banked to 20 deg", None, 1.0),
    )


def _advise(
    solved: AdjustedMounting,
    antenna: Array,
    J: Array,
    out: list[MountingComponent],
    undetermined: Sequence[int],
) -> None:
    """Try each variant, and write what determines a component beside it."""
    hypothetical = [(v.name, solved.with_line(v)) for v in _variants()]
    none = np.zeros(3)
    if CAMERA_FIXED in solved.place:
        advice = (
            "poses with the covariance of their whole block (adjust --pose-covariance), or a camera"
            " known to move them by 5 mm and 0.002 deg alike (--pose-sigma 0.005,0.002)"
        )
        alike = np.eye(len(solved.cov))[solved.place[CAMERA_FIXED]]
        alike[3:] *= ALIKE_M / ALIKE_RAD
        hypothetical.append((advice, solved.conditioned(alike, np.zeros(6), ALIKE_M)[1]))
    if solved.block.georeferenced and solved.assumptions.shift_sigma_m is None:
        advice = "ground control in the datum of the fixes to 1 cm (--shift-sigma 0.01)"
        frame = np.eye(len(solved.cov))[solved.place[TRANSLATION]]
        hypothetical.append((advice, solved.conditioned(frame, none, 0.01)[1]))
    advice = "an antenna lever arm measured to 5 mm from the projection centre"
    hypothetical.append((advice, solved.conditioned(antenna, none, 0.005)[1]))
    for k in undetermined:
        c, row = out[k], J[k]
        useful = [t for t in hypothetical if not (c.group == "antenna_m" and "antenna" in t[0])]
        sigmas = [float(np.sqrt(max(row @ cov @ row, 0.0))) for _, cov in useful]
        good = [i for i in range(len(useful)) if sigmas[i] <= c.limit]
        good = ([i for i in good if sigmas[i] <= 0.7 * c.limit] or good)[:2]
        best = int(np.argmin(sigmas))
        if not good and sigmas[best] < 0.5 * c.sigma:
            good = [best]
        remedies = tuple(
            f"{useful[i][0]} would give {value_text(c.group, sigmas[i])}" for i in good
        )
        out[k] = replace(c, remedies=remedies)


def misread_boresight(stated: Stated, judged: Sequence[MountingComponent], B: Array) -> str | None:
    """Say how a bore-sight of the flight file was misread, where that explains the difference.

    Signs and order of its angles and the sense of the matrix are tried.

    Parameters
    ----------
    stated : Stated
        The flight file's.
    judged : sequence of MountingComponent
        The verdicts.
    B : ndarray, (3, 3)
        The bore-sight that was found.

    Returns
    -------
    str or None
        A sentence; None where the bore-sight does not contradict, or nothing explains it.
    """
    components = [c for c in judged if c.group == "boresight"]
    if not any(c.verdict == CONTRADICTING for c in components):
        return None
    B0 = stated.mounting.boresight
    limit = 3.0 * float(np.sqrt(3.0 * STATED_BORESIGHT**2 + sum(c.sigma**2 for c in components)))
    opk = opk_from_rotation(B0)[None]
    readings = {"body and camera exchanged (transposed)": B0.T}
    for one in angles(CAMERA_SETS["opk"], {}, units=()):
        readings[one.words] = one.change(opk)[0]

    def apart(A: Array) -> float:
        return float(np.linalg.norm(vector_from_rotation(A @ B.T)))

    explanation = explain(B0, readings_of(readings), apart, limit)
    if explanation is None:
        return None
    return (
        "the flight file's bore-sight would agree with what was found if it had"
        f" {explanation.clauses()} ({np.degrees(explanation.left):.3f} deg instead of"
        f" {np.degrees(explanation.before):.3f} deg)"
    )
