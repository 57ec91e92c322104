"""Recognition of a recording: units, axes, sign of force and clock of an IMU.

They are found from its numbers and the GNSS fixes alone.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..geodesy.gpstime import WEEK_S, weeks_apart
from ..geodesy.rotation import right_angle_rotations
from ..prepare.clock import cut_fixes, cut_samples
from ..prepare.fix_path import liveliest, sound_fixes
from ..records import Array, Check, GnssFixes, ImuSamples, Quantity, Verdict
from .axes import Direction, Forward, Pose, axes_words, down, forward, poses, scores
from .findings import MOST, NAMES, Finding
from .propulsion import propulsion
from .relation import MAX_LAG_S, Relation, relate
from .signal import ImuGrid, dead_channel, imu_grid
from .units import ACCEL_UNITS, GYRO_UNITS, ForceUnit, force_unit, gyro_unit, unknown_force
from .verdict import (
    TELLING,
    exchange_odds,
    nothing,
    of_clock,
    of_forward,
    of_gyro,
    of_sign,
    of_vertical,
)

EXCHANGED_ADVICE = (
    "latitude and longitude are exchanged: exchange their names in gnss.columns or in the file"
)
SURE = 0.99  # a confidence above which a claim is contradicted
INCREMENT_UNITS = {"rad": 1.0, "deg": np.pi / 180.0, "m/s": 1.0}
SENSOR_UNITS = {"gyro": (*GYRO_UNITS, "rad", "deg"), "accel": (*ACCEL_UNITS, "m/s")}
LEAST_OFFSET_S = 0.02  # a time offset that is reported
COMMON_S, WIDE_S = (
    10.0,
    900.0,
)  # s that clocks must have in common to be one, and how far starts may lie apart if they are not
LOOKED_AT_S = 300.0  # of the fixes: enough turns and changes of speed for all that motion can show
OFFSET_LIMIT_S = (
    0.5  # a time offset that stops the job; below it the filter copes, and a note reports it
)


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
    findings : tuple of Finding
        One for each of `findings.NAMES`, in that order.
    curves : dict of str to ndarray
        Arrays for a picture (`recognise` lists them).
    exchanged : bool
        Whether latitude and longitude are; the sign of the force and the axes are then abstained
        from.
    """

    quantity: Quantity
    gyro_unit: str
    accel_unit: str
    gyro_factor: float
    accel_factor: float
    axes: str | None
    accel_sign: int
    time_offset_s: float
    time_offset_sigma_s: float
    time_scale: str
    findings: tuple[Finding, ...]
    curves: dict[str, Array]
    exchanged: bool = False

    def finding(self, name: str) -> Finding:
        """Return the finding of that name."""
        return next(f for f in self.findings if f.name == name)


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
        return _abstained(unknown_force(1.0, why), 1.0, why)
    force = force_unit(grid)
    per_sample = grid.interval if force.quantity == "increments" else 1.0
    shift, reach = _clocks(imu, gnss)
    gnss = replace(gnss, time=gnss.time + shift)
    relation = relate(grid, gnss, sound, force, reach)
    if relation is None:
        return _abstained(
            force,
            per_sample,
            "too few fixes or readings in common with GNSS, or gyros that show nothing",
        )
    if relation.fit is None:
        why = "at no time offset and in no unit does the IMU explain the motion that GNSS saw"
        return _abstained(force, per_sample, why, _scores(relation))
    mirrored = _mirrored(relation, grid, gnss, sound, force, reach)
    return _recognised(
        relation,
        force,
        grid.interval,
        imu.gps_week or gnss.gps_week,
        poses(relation, gnss, sound),
        shift,
        mirrored,
    )


def recognise_liveliest(imu: ImuSamples, gnss: GnssFixes) -> Recognition:
    """Apply `recognise` to the liveliest `LOOKED_AT_S` of the fixes.

    The samples reach far enough for every time offset that is looked for.
    """
    lo, hi = liveliest(gnss, LOOKED_AT_S)
    return recognise(cut_samples(imu, lo - MAX_LAG_S, hi + MAX_LAG_S), cut_fixes(gnss, lo, hi))


def _mirrored(
    relation: Relation,
    grid: ImuGrid,
    gnss: GnssFixes,
    sound: NDArray[np.bool_],
    force: ForceUnit,
    reach: float,
) -> float:
    """What specific force explains with latitude and longitude exchanged.

    It is -inf where that need not, or cannot, be looked at.
    """
    scan = relation.scan
    if (
        scan.up[scan.best] >= scan.down[scan.best]
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


def _recognised(
    relation: Relation,
    force: ForceUnit,
    interval: float,
    week: int | None,
    pose: Pose,
    shift: float,
    mirrored: float,
) -> Recognition:
    """All answers, each at most as sure as the findings that it is based on."""
    of_unit, triads = of_gyro(relation, force, interval)
    trusted = min(force.of_unit.confidence or MOST, of_unit.confidence, triads.confidence)
    clock = of_clock(relation, week, trusted, shift)
    sign, of_force = of_sign(relation, min(trusted, clock.of_offset.confidence), mirrored)
    vertical = down(pose)
    of_down = of_vertical(vertical, of_force.confidence)
    ahead = forward(pose, vertical)
    assert relation.fit is not None
    moved = propulsion(pose.time, pose.C_ns, relation.fit.felt, ahead.direction.axis)
    of_ahead = of_forward(ahead, moved, of_down.confidence)
    C_b_imu = np.array(
        [ahead.direction.axis, np.cross(vertical.axis, ahead.direction.axis), vertical.axis]
    )
    axes = axes_words(C_b_imu) if of_ahead.confidence and triads.value == "aligned" else None
    of_axes = Finding(
        "axes",
        axes or "unknown",
        of_ahead.confidence if axes else 0.0,
        f"{of_down.evidence}; {of_ahead.evidence}",
    )
    unit_is_known, per_sample = (
        of_unit.confidence > 0.0,
        interval if force.quantity == "increments" else 1.0,
    )
    factor = relation.factors[relation.best]
    return Recognition(
        force.quantity,
        gyro_unit(factor, force.quantity, interval) if unit_is_known else _plain_gyro_unit(force),
        force.unit,
        factor * per_sample if unit_is_known else 1.0,
        force.factor * per_sample,
        axes,
        sign if of_force.confidence else 1,
        clock.offset_s,
        clock.sigma_s,
        clock.scale,
        (
            force.of_quantity,
            force.of_unit,
            of_unit,
            triads,
            of_force,
            of_down,
            of_ahead,
            of_axes,
            clock.of_offset,
            clock.of_scale,
        ),
        _scores(relation)
        | _motion(relation, pose, C_b_imu if axes else np.eye(3))
        | _orientations(vertical, ahead),
        clock.of_offset.confidence > 0.0
        and bool(np.isfinite(mirrored))
        and exchange_odds(relation, mirrored) > TELLING,
    )


def _plain_gyro_unit(force: ForceUnit) -> str:
    return "rad" if force.quantity == "increments" else "rad/s"


def _abstained(
    force: ForceUnit, per_sample: float, why: str, curves: dict[str, Array] | None = None
) -> Recognition:
    """What is left where GNSS does not help: the unit of the accelerometers."""
    findings = (force.of_quantity, force.of_unit, *nothing(NAMES[2:], why))
    plain = _plain_gyro_unit(force)
    factor = force.factor * per_sample
    return Recognition(
        force.quantity,
        plain,
        force.unit,
        1.0,
        factor,
        None,
        1,
        0.0,
        np.inf,
        "same",
        findings,
        curves or {},
    )


def _scores(relation: Relation) -> dict[str, Array]:
    scan = relation.scan
    return {
        "lag_s": scan.lags,
        "lag_score": scan.score,
        "gyro_factor": np.array(relation.factors),
        "gyro_factor_score": np.array([s.score.max() for s in relation.scans]),
    }


def _orientations(vertical: Direction, ahead: Forward) -> dict[str, Array]:
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
    first, last = (
        np.maximum(fit.middle - reach, 0),
        np.minimum(fit.middle + reach, moved.C.shape[0] - 1),
    )
    change = (moved.turned[last] - moved.turned[first]) / (moved.grid.step * (last - first))[
        :, None
    ]
    rate = np.einsum("nij,nkj,nk->ni", pose.C_ns, moved.C[fit.middle], change)[:, 2]
    return {
        "time": pose.time,
        "force_gnss": np.einsum("nij,nj->ni", C_bn, fit.seen),
        "force_imu": np.einsum("nij,nj->ni", C_bn, fit.felt),
        "turn_gnss": pose.course_rate,
        "turn_gyro": rate,
    }


def compare(
    recognition: Recognition,
    C_b_imu: Array,
    *,
    quantity: str = "mean_rate",
    gyro_unit: str = "rad/s",
    accel_unit: str = "m/s^2",
    accel_sign: int = 1,
    time_offset_s: float = 0.0,
) -> list[Check]:
    """Compare the flight file's claim with the data.

    Parameters
    ----------
    recognition : Recognition
        Of the records as the claim makes them: converted to SI from the claimed units, force with
        the claimed sign, GNSS with the claimed time offset, IMU in its own axes. It has factor 1,
        sign +1 and no offset if the claim is right.
    C_b_imu : ndarray, shape (3, 3)
        The claimed axes; this and the following go into the advice.
    quantity, gyro_unit, accel_unit : str
    accel_sign : int
        +1 or -1.
    time_offset_s : float, s
        GNSS minus IMU offset.

    Returns
    -------
    list of Check
        "recognised units", "recognised axes", "recognised sign" and "recognised clock":
        "contradiction" where the data are surer than `SURE` of something else (of a clock: by more
        than `OFFSET_LIMIT_S`), "note" where they do not determine it or are less sure, "ok"
        otherwise.
    """
    return [
        _compare_units(recognition, quantity, gyro_unit, accel_unit),
        _compare_axes(recognition, C_b_imu),
        _compare_sign(recognition, accel_sign),
        _compare_clock(recognition, time_offset_s),
    ]


def _compare_units(
    recognition: Recognition, quantity: str, gyro_unit: str, accel_unit: str
) -> Check:
    """Compare the units. A factor other than 1 shows by what the claim is wrong."""
    name, expected = (
        "recognised units",
        f"gyro in {gyro_unit}, accelerometer in {accel_unit}, {quantity}",
    )
    sensors = (
        (
            "gyro",
            recognition.finding("gyro unit"),
            recognition.gyro_factor,
            GYRO_UNITS | INCREMENT_UNITS,
            gyro_unit,
        ),
        (
            "accel",
            recognition.finding("accelerometer unit"),
            recognition.accel_factor,
            ACCEL_UNITS | INCREMENT_UNITS,
            accel_unit,
        ),
    )
    wrong_quantity = (quantity == "increments") != (recognition.quantity == "increments")
    advice, sure, evidence = [], 1.0, []
    for sensor, finding, factor, units, claimed in sensors:
        evidence.append(f"{finding.name} {finding.value}: {finding.evidence}")
        if not finding.confidence or (abs(np.log(factor)) < 1e-6 and not wrong_quantity):
            continue
        true = factor * units[claimed]
        of_quantity = INCREMENT_UNITS if recognition.quantity == "increments" else units
        unit = next(
            (
                u
                for u, f in of_quantity.items()
                if abs(np.log(true / f)) < 1e-6 and u in SENSOR_UNITS[sensor]
            ),
            None,
        )
        look = f'the numbers look like imu.units {sensor} = "{unit}"'
        advice.append(
            look if unit else f"the numbers are off by {factor:.4g}, check imu.units {sensor}"
        )
        sure = min(sure, finding.confidence)
    if wrong_quantity and recognition.finding("quantity").confidence:
        advice.append(f'they look like imu.quantity = "{recognition.quantity}"')
    if advice:
        verdict: Verdict = "contradiction" if sure > SURE else "note"
        return Check(name, "; ".join(evidence), expected, verdict, "; ".join(advice))
    silent = [finding.name for _, finding, *_ in sensors if not finding.confidence]
    return Check(
        name,
        "; ".join(evidence),
        expected,
        "note" if silent else "ok",
        f"the data do not determine the {' and '.join(silent)}" if silent else "",
    )


REVERSED = "gyro -x -y -z"  # of the words of `verdict.triads_words`


def _compare_axes(recognition: Recognition, C_b_imu: Array) -> Check:
    """Compare the orientation where it is known, else its vertical axis, else the gyros' sense."""
    name, claimed = "recognised axes", axes_words(C_b_imu)
    finding, vertical, triads = (
        recognition.finding(n) for n in ("axes", "vertical axis", "gyro triad")
    )
    if triads.value not in ("aligned", "unknown"):
        advice = (
            f"about the accelerometers' x y z turn {triads.value}: correct imu.columns or the signs"
            " in the file"
        )
        if triads.value == REVERSED and recognition.accel_sign < 0:
            advice += (
                "; two axes that are exchanged in gyro and accelerometer alike look so, too, as do"
                " six reversed signs: look at the order of the columns first"
            )
        return Check(
            name,
            f"{triads.value}; {triads.evidence}",
            claimed,
            "contradiction" if triads.confidence > SURE else "note",
            advice,
        )
    statement = f"{recognition.axes or 'unknown'} ({finding.evidence})"
    if recognition.axes == claimed:
        return Check(name, statement, claimed)
    down_word = vertical.value.split()[0]
    if vertical.confidence > SURE and down_word != _imu_word(C_b_imu[2]):
        hint = (
            f'imu.axes = "{recognition.axes}"'
            if recognition.axes
            else f"imu.axes must have the IMU's {down_word} down"
        )
        return Check(name, statement, claimed, "contradiction", f"the data look like {hint}")
    if recognition.axes is None:
        return Check(
            name, statement, claimed, "note", "the data do not determine which axis is forward"
        )
    verdict: Verdict = "contradiction" if finding.confidence > SURE else "note"
    advice = f'the data look like imu.axes = "{recognition.axes}"'
    if verdict == "note":
        advice += ", if it moves nose first"
    return Check(name, statement, claimed, verdict, advice)


def _imu_word(direction: Array) -> str:
    k = int(np.argmax(np.abs(direction)))
    return ("+" if direction[k] > 0 else "-") + "xyz"[k]


def _compare_sign(recognition: Recognition, accel_sign: int) -> Check:
    name, finding = "recognised sign", recognition.finding("force sign")
    expected = "specific force (up at rest)" + (
        ", with the sign of the claim" if accel_sign < 0 else ""
    )
    statement = f"{finding.value}: {finding.evidence}"
    if recognition.exchanged:
        return Check(name, statement, expected, "contradiction", EXCHANGED_ADVICE)
    if not finding.confidence:
        return Check(
            name, statement, expected, "note", "the data do not determine the sign of the force"
        )
    if recognition.accel_sign > 0:
        return Check(name, statement, expected)
    verdict: Verdict = "contradiction" if finding.confidence > SURE else "note"
    advice = (
        f"the accelerometers report the reverse: imu.accel_sign = {-accel_sign}; or latitude and"
        " longitude are exchanged, or one of them has the wrong sign"
    )
    return Check(name, statement, expected, verdict, advice)


def _compare_clock(recognition: Recognition, time_offset_s: float) -> Check:
    name, finding = "recognised clock", recognition.finding("time offset")
    expected, statement = (
        f"GNSS on the IMU's clock within {OFFSET_LIMIT_S} s",
        f"{finding.value}: {finding.evidence}",
    )
    if not finding.confidence:
        return Check(name, statement, expected, "note", "the data do not determine the time offset")
    offset, sigma = recognition.time_offset_s, recognition.time_offset_sigma_s
    if abs(offset) < max(3.0 * sigma, LEAST_OFFSET_S):
        return Check(name, statement, expected)
    advice = (
        f"gnss.time_offset_s = {time_offset_s + offset:.3f} would put the fixes on the IMU's clock"
    )
    if weeks := weeks_apart(offset):
        sense = "behind" if offset > 0.0 else "ahead of"
        statement = f"the fixes are {weeks} {sense} the IMU: {statement}"
        whole = time_offset_s + WEEK_S * round(offset / WEEK_S)
        advice = (
            "the times of one of them are of another week, or count from another one: give both as"
            f" times of one week; gnss.time_offset_s = {whole:.1f} would do it"
        )
    if recognition.time_scale in ("GNSS in UTC", "IMU in UTC"):
        advice += f" ({recognition.time_scale}, leap seconds)"
    return Check(
        name,
        statement,
        expected,
        "contradiction" if abs(offset) > OFFSET_LIMIT_S and finding.confidence > SURE else "note",
        advice,
    )
