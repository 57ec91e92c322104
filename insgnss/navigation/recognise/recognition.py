"""Recognition of a recording: units, axes, sign of force and clock of an IMU.

They are found from its numbers and the GNSS fixes alone.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...base.findings.remedies import Step
from ...geodesy.axes import axes_words
from ...geodesy.rotation import right_angle_rotations
from ...records import Array, Finding, GnssFixes, ImuSamples, Quantity
from ..prepare.clock import cut_fixes, cut_samples
from ..prepare.fix_path import liveliest, sound_fixes
from .axes import Direction, ForwardAxis, Pose, down_direction, forward, poses, scores
from .findings import MOST_CONFIDENCE, answer, unknown_property
from .propulsion import propulsion
from .relation import MAX_LAG_S, Relation, relate
from .signal import ImuGrid, dead_channel, imu_grid
from .units import ForceUnit, force_unit, gyro_unit, unknown_force
from .verdict import (
    LEAST_LOG_ODDS,
    exchange_odds,
    looks_counted,
    of_clock,
    of_forward,
    of_gyro,
    of_sign,
    of_vertical,
)

EXCHANGED_ADVICE = Step(
    "latitude and longitude are exchanged: exchange their names in {gnss.columns} or in the file"
)
# what motion alone shows, in the order in which `_combine_findings` lists it
OF_MOTION = (
    *("gyro unit", "gyro triad", "force sign", "vertical axis", "forward axis", "axes"),
    *("time offset", "time scale"),
)
# s that clocks must have in common to be one, and how far starts may lie apart if they are not
COMMON_S, WIDE_S = 10.0, 900.0
LOOKED_AT_S = 300.0  # of the fixes: enough turns and changes of speed for all that motion can show


@dataclass(frozen=True, eq=False)
class Recognition:
    """What the data show of themselves.

    A field whose finding has confidence 0 holds what the records were read as.

    Parameters
    ----------
    quantity : str
        "mean_rate" (also for instantaneous rates, which the data do not distinguish from mean ones)
        or "increments".
    gyro_unit, accel_unit : str
        Units of the numbers, in the words of the flight file.
    gyro_factor, accel_factor : float
        Factors by which the numbers must be multiplied to be rad/s and m/s^2, of increments rad and
        m/s. Numbers that a claim has converted wrongly have factors that belong to no unit; the
        name of the unit is empty then.
    findings : tuple of Finding
        One for each property, in the order in which `_combine_findings` lists them.
    curves : dict of str to ndarray
        Arrays for a picture (`recognise` lists them).
    axes : str or None
        Body directions of the IMU's x, y and z in the words of `axes`; None where the data do not
        determine them.
    accel_sign : int
        +1 where the accelerometers report specific force (up at rest), -1 where they report its
        reverse.
    time_offset_s, time_offset_sigma_s : float, s
        Time offset that must be added to the GNSS stamps to be on the IMU's clock, and its sigma.
        (0, inf) where the data do not determine it.
    time_scale : str
        "same", "GNSS in UTC" or "IMU in UTC" where the offset is the leap seconds of the date (18 s
        without a week) within half a second, "other" where it is larger than half a second
        otherwise.
    exchanged : bool
        Whether latitude and longitude are; the sign of the force and the axes are then abstained
        from.
    down : str
        Which of the IMU's axes points down, in words; empty where the data do not determine it.
    compared : bool
        Whether the motion that the IMU felt could be compared with that of the fixes.
    gyro_counts : bool
        Whether the gyros fit no known unit, as numbers in counts.
    exchanges : tuple of Exchange
        Of readings of left-handed axes the exchanges of two axes that explain the motion, where
        they were tried (`handedness.with_exchanges`).
    """

    quantity: Quantity
    gyro_unit: str
    accel_unit: str
    gyro_factor: float
    accel_factor: float
    findings: tuple[Finding, ...]
    curves: dict[str, Array]
    axes: str | None = None
    accel_sign: int = 1
    time_offset_s: float = 0.0
    time_offset_sigma_s: float = np.inf
    time_scale: str = "same"
    exchanged: bool = False
    down: str = ""
    compared: bool = False
    gyro_counts: bool = False
    exchanges: "tuple[Exchange, ...]" = ()

    def finding(self, name: str) -> Finding:
        """Return the finding of that name."""
        return next(f for f in self.findings if f.name == name)


@dataclass(frozen=True, eq=False)
class Exchange:
    """Two axes exchanged in gyros and accelerometers alike, with which the motion is explained.

    Parameters
    ----------
    pair : tuple of int
        The two axes, 0 to 2.
    recognition : Recognition
        What the readings show with both exchanged, of specific force.
    """

    pair: tuple[int, int]
    recognition: Recognition

    @property
    def words(self) -> tuple[str, str]:
        """The letters of both axes."""
        return "xyz"[self.pair[0]], "xyz"[self.pair[1]]


def recognise(imu: ImuSamples, gnss: GnssFixes) -> Recognition:
    """Find units, axes, sign of force and clock.

    Parameters
    ----------
    imu : ImuSamples
        The numbers as the file has them, in the sensor's own axes, whatever their unit; its
        `quantity` only says whether a stamp ends an interval (mean rate, increments) or is an
        instant.
    gnss : GnssFixes
        Fixes in rad and m; with velocities where the receiver gives them.

    Returns
    -------
    Recognition
        The recogniser raises nothing: what too few data do not determine is abstained from.

    Notes
    -----
    The `curves` are the following, with m rows of the windows in which GNSS saw most motion. All
    are absent where there is too little to look at, all but the scores of lags and units where
    nothing fits.

    time : (m,), s
        On the IMU's clock.
    force_gnss, force_imu : (m, 3), m/s^2
        Specific force in body axes (in the IMU's where axes is None) from the motion that GNSS saw
        (gross fixes and all) and from the accelerometers, averaged alike.
    turn_gnss, turn_gyro : (m,), rad/s
        Rate of turn about the vertical, NaN where GNSS is too slow to have a course.
    lag_s, lag_score : (n,), s and 1
        Share of the GNSS accelerations that the IMU explains at that time offset (1 all, 0 none,
        negative worse than nothing).
    gyro_factor, gyro_factor_score : (h,)
        The same for the candidate gyro units.
    orientation, orientation_score : (24, 3, 3) and (24,)
        C_b_imu of all orientations (words by `axes.axes_words`), and a score of -1 to 1.
    """
    grid, sound = imu_grid(imu), sound_fixes(gnss)
    if dead := dead_channel(imu):
        why = f"{dead} repeats one value for much of the recording"
        return _without_gnss(unknown_force(1.0, why), 1.0, why)
    force = force_unit(grid)
    per_sample = grid.interval if force.quantity == "increments" else 1.0
    shift, reach = _clocks(imu, gnss)
    gnss = replace(gnss, time=gnss.time + shift)
    relation = relate(grid, gnss, sound, force, reach)
    if relation is None:
        why = "too few fixes or samples in common, or gyros without signal"
        return _without_gnss(force, per_sample, why)
    if relation.fit is None:
        why = (
            "the IMU explains the motion that GNSS saw at no time offset and in no unit: check that"
            " both files are of one flight"
        )
        return _without_gnss(force, per_sample, why, _scores(relation))
    mirror = _exchange_latitude_longitude(relation, grid, gnss, sound, force, reach)
    week, pose = imu.gps_week or gnss.gps_week, poses(relation, gnss, sound)
    return _combine_findings(relation, force, grid.interval, week, pose, shift, mirror)


def recognise_liveliest(imu: ImuSamples, gnss: GnssFixes) -> Recognition:
    """Apply `recognise` to the liveliest `LOOKED_AT_S` of the fixes.

    The samples reach far enough for every time offset that is looked for.
    """
    return recognise_between(imu, gnss, *liveliest(gnss, LOOKED_AT_S))


def recognise_between(imu: ImuSamples, gnss: GnssFixes, lo: float, hi: float) -> Recognition:
    """Apply `recognise` to the fixes between two instants, s, and the samples around them."""
    return recognise(cut_samples(imu, lo - MAX_LAG_S, hi + MAX_LAG_S), cut_fixes(gnss, lo, hi))


def _exchange_latitude_longitude(
    relation: Relation,
    grid: ImuGrid,
    gnss: GnssFixes,
    sound: NDArray[np.bool_],
    force: ForceUnit,
    reach: float,
) -> float:
    """What specific force explains with latitude and longitude exchanged.

    It is -inf where that need not, or cannot, be looked at. That exchange mirrors the world, not
    the sensor: it leaves the gyros as they are.
    """
    scan = relation.scan
    if (
        not np.array_equal(relation.triads, np.eye(3))
        or scan.up[scan.best] >= scan.down[scan.best]
        or gnss.velocity_ned is not None
        or np.abs(gnss.lon).max() >= 0.5 * np.pi
    ):
        return -np.inf
    other = relate(grid, replace(gnss, lat=gnss.lon, lon=gnss.lat), sound, force, reach)
    return -np.inf if other is None else float(other.scan.up[other.scan.best])


def _clocks(imu: ImuSamples, gnss: GnssFixes) -> tuple[float, float]:
    """What to add to the GNSS stamps before lags are looked for, and how far to look, s.

    Clocks that have nothing in common are set to a common start.
    """
    common = min(imu.time[-1], gnss.time[-1]) - max(imu.time[0], gnss.time[0])
    if common >= COMMON_S:
        return 0.0, MAX_LAG_S
    longest = max(imu.time[-1] - imu.time[0], gnss.time[-1] - gnss.time[0])
    return float(imu.time[0] - gnss.time[0]), float(np.clip(longest, 2.0 * MAX_LAG_S, WIDE_S))


def _combine_findings(
    relation: Relation,
    force: ForceUnit,
    interval: float,
    week: int | None,
    pose: Pose,
    shift: float,
    mirror: float,
) -> Recognition:
    """All answers, each at most as sure as the findings that it is based on."""
    of_unit, triads = of_gyro(relation, force, interval)
    of_force_unit = force.of_unit.confidence or MOST_CONFIDENCE
    trusted = min(of_force_unit, of_unit.confidence, triads.confidence)
    clock = of_clock(relation, week, trusted, shift)
    sign, of_force = of_sign(relation, min(trusted, clock.of_offset.confidence), mirror)
    vertical = down_direction(pose)
    of_down = of_vertical(vertical, of_force.confidence)
    ahead = forward(pose, vertical)
    assert relation.fit is not None
    moved = propulsion(pose.time, pose.C_ns, relation.fit.felt, ahead.direction.axis)
    of_ahead = of_forward(ahead, moved, of_down.confidence)
    right = np.cross(vertical.axis, ahead.direction.axis)
    C_b_imu = np.array([ahead.direction.axis, right, vertical.axis])
    axes = axes_words(C_b_imu) if of_ahead.confidence and triads.found == "aligned" else None
    evidence = f"{of_down.evidence}; {of_ahead.evidence}"
    of_axes = answer("axes", axes or "", of_ahead.confidence if axes else 0.0, evidence)
    unit_is_known = of_unit.confidence > 0.0
    per_sample = interval if force.quantity == "increments" else 1.0
    factor, unit = 1.0, _plain_gyro_unit(force)
    if unit_is_known:
        factor = relation.factors[relation.best] * per_sample
        unit = gyro_unit(relation.factors[relation.best], force.quantity, interval)
    of_axis = of_force, of_down, of_ahead, of_axes
    of_clocks = clock.of_offset, clock.of_scale
    findings = force.of_quantity, force.of_unit, of_unit, triads, *of_axis, *of_clocks
    motion = _motion(relation, pose, C_b_imu if axes else np.eye(3))
    mirror_is_known = clock.of_offset.confidence > 0.0 and bool(np.isfinite(mirror))
    return Recognition(
        force.quantity,
        unit,
        force.unit,
        factor,
        force.factor * per_sample,
        findings,
        _scores(relation) | motion | _orientations(vertical, ahead),
        axes,
        sign if of_force.confidence else 1,
        clock.offset_s,
        clock.sigma_s,
        clock.scale,
        mirror_is_known and exchange_odds(relation, mirror) > LEAST_LOG_ODDS,
        down=vertical.word if of_down.confidence else "",
        compared=True,
        gyro_counts=looks_counted(relation),
    )


def _plain_gyro_unit(force: ForceUnit) -> str:
    return "rad" if force.quantity == "increments" else "rad/s"


def _without_gnss(
    force: ForceUnit, per_sample: float, why: str, curves: dict[str, Array] | None = None
) -> Recognition:
    """What is left where GNSS does not help: the unit of the accelerometers."""
    of_motion = (unknown_property(name, why) for name in OF_MOTION)
    findings = (force.of_quantity, force.of_unit, *of_motion)
    units = _plain_gyro_unit(force), force.unit
    factors = 1.0, force.factor * per_sample
    return Recognition(force.quantity, *units, *factors, findings, curves or {})


def _scores(relation: Relation) -> dict[str, Array]:
    scan = relation.scan
    return {
        "lag_s": scan.lags,
        "lag_score": scan.score,
        "gyro_factor": np.array(relation.factors),
        "gyro_factor_score": np.array([s.score.max() for s in relation.scans]),
    }


def _orientations(vertical: Direction, ahead: ForwardAxis) -> dict[str, Array]:
    return {
        "orientation": right_angle_rotations(),
        "orientation_score": scores(vertical.vector, ahead.direction.vector),
    }


def _motion(relation: Relation, pose: Pose, C_b_imu: Array) -> dict[str, Array]:
    """Specific force and turn rate, of GNSS and of the IMU."""
    fit, moved = relation.fit, relation.propagated
    assert fit is not None
    C_bn = C_b_imu @ np.swapaxes(pose.C_ns, 1, 2)
    reach = max(1, round(0.25 * pose.width / moved.grid.step))
    first = np.maximum(fit.middle - reach, 0)
    last = np.minimum(fit.middle + reach, moved.C.shape[0] - 1)
    length = moved.grid.step * (last - first)
    change = (moved.turned[last] - moved.turned[first]) / length[:, None]
    rate = np.einsum("nij,nkj,nk->ni", pose.C_ns, moved.C[fit.middle], change)[:, 2]
    return {
        "time": pose.time,
        "force_gnss": np.einsum("nij,nj->ni", C_bn, fit.seen),
        "force_imu": np.einsum("nij,nj->ni", C_bn, fit.felt),
        "turn_gnss": pose.course_rate,
        "turn_gyro": rate,
    }
