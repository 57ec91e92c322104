"""What samples without a receiver show: gravity gives the unit of force and the vertical.

|f| at rest is 9.78 to 9.83 m/s^2 wherever it is measured, so its median distinguishes m/s^2, g and
mg; a value between is what one count is worth if the sensor is free of scale errors, which it is
to some per cent. The gyros of a sensor at rest see the Earth, 7.3e-5 rad/s, and only the best of
them above their bias: for all others the recording does not show the unit, and they are read as
rad/s, or as deg/s where at rest they scatter by more than any sensor does in rad/s.
"""

from dataclasses import dataclass, replace

import numpy as np

from ...base.units import STANDARD_GRAVITY
from ...geodesy.earth import EARTH_RATE
from ...navigation.prepare.gaps import nominal_interval
from ...navigation.recognise.findings import MOST_CONFIDENCE, answer, unknown_property
from ...navigation.recognise.units import ACCEL_UNITS
from ...records import Array, Finding, ImuSamples
from .sensing import DEG_S, Sensing

NEAR_UNIT = 0.1  # of |f| to gravity, to suggest a unit
SCATTER_AT_REST = 0.03  # scatter of |f| over its median at rest
# rad/s, scatter of samples at rest: beyond any sensor, and that of a usual one
NOISIEST_GYRO, QUIET_GYRO = 0.015, 0.005


def gyro_scatter(imu: ImuSamples) -> float:
    """Return the standard deviation of a gyro sample about its neighbours, in the file's unit.

    It is that of the axis with the largest one.
    """
    return float(np.sqrt(0.5 * np.mean(np.diff(imu.gyro, axis=0) ** 2, axis=0)).max())


@dataclass(frozen=True, eq=False)
class Alone:
    """What samples without a receiver show.

    Parameters
    ----------
    imu : ImuSamples
        In SI, as rates.
    units : dict of str to str
        The units found, keys gyro and accel, where they are not SI.
    findings : tuple of Finding
    gyro_counts : float or None, rad/s
        What one unit of the gyro was taken for where the recording does not show it, else None; an
        assumption for stationarity detection.
    """

    imu: ImuSamples
    units: dict[str, str]
    findings: tuple[Finding, ...]
    gyro_counts: float | None = None


def by_gravity(imu: ImuSamples, free: bool) -> Alone:
    """Find the units by gravity and the Earth rate.

    Parameters
    ----------
    imu : ImuSamples
        Samples in the file's units.
    free : bool
        Whether nothing in the file gives the units; else they are kept.

    Returns
    -------
    Alone
    """
    dt = nominal_interval(imu.time)
    if imu.quantity == "increments":
        imu = replace(imu, gyro=imu.gyro / dt, accel=imu.accel / dt, quantity="mean_rate")
    if not free:
        return Alone(imu, {}, ())
    norm = np.linalg.norm(imu.accel, axis=1)
    typical, scatter = float(np.median(norm)), float(np.std(norm))
    force_unit, factor, confidence = _force_unit(typical)
    at_rest = scatter < SCATTER_AT_REST * typical
    units = {} if force_unit == "m/s^2" else {"accel": force_unit}
    evidence = (
        f"median size of the specific force {typical:.5g}, scatter {scatter:.2g}; gravity is "
        f"{STANDARD_GRAVITY:.3f} m/s^2"
    )
    findings = [
        answer(
            "accelerometer unit", force_unit, confidence if at_rest else 0.5 * confidence, evidence
        )
    ]
    gyro_factor, gyro = (
        1.0,
        unknown_property("gyro unit", "the sensor moves, and no receiver shows how"),
    )
    if at_rest:
        gyro_factor, gyro = _gyro_unit(imu)
    findings.append(gyro)
    if gyro_factor == DEG_S:
        units["gyro"] = gyro.found
    in_si = replace(imu, gyro=imu.gyro * gyro_factor, accel=imu.accel * factor)
    return Alone(
        in_si, units, tuple(findings), gyro_factor if gyro_factor not in (1.0, DEG_S) else None
    )


def _force_unit(typical: float) -> tuple[str, float, float]:
    """Unit of the median norm, its factor to m/s^2, and the confidence."""
    for unit, factor in ACCEL_UNITS.items():
        if abs(typical * factor / STANDARD_GRAVITY - 1.0) < NEAR_UNIT:
            return unit, factor, MOST_CONFIDENCE
    factor = STANDARD_GRAVITY / max(typical, 1e-12)
    return f"{factor:.5g} m/s^2", factor, 0.6


def _gyro_unit(imu: ImuSamples) -> tuple[float, Finding]:
    """Factor to rad/s, an assumption but for the Earth rate, and the finding."""
    scatter = gyro_scatter(imu)
    mean = float(np.linalg.norm(imu.gyro.mean(axis=0)))
    if abs(mean / EARTH_RATE - 1.0) < NEAR_UNIT:
        evidence = f"mean rate {mean:.4g}; the Earth turns by {EARTH_RATE:.4g} rad/s"
        return 1.0, answer("gyro unit", "rad/s", 0.95, evidence)
    evidence = (
        f"noise of a gyro sample {scatter:.3g}; at rest only the Earth's rotation can show the "
        f"unit, and the mean rate ({mean:.3g}) does not match it"
    )
    if scatter < NOISIEST_GYRO:
        return 1.0, unknown_property("gyro unit", evidence)
    if scatter * DEG_S < NOISIEST_GYRO:
        return DEG_S, answer(
            "gyro unit", "deg/s", 0.5, f"{evidence}; in rad/s no sensor is that noisy"
        )
    evidence = (
        f"{evidence}; no sensor is that noisy in rad/s or deg/s, so the values are counts; give "
        "the value of one count in imu.units gyro"
    )
    return QUIET_GYRO / scatter, unknown_property("gyro unit", evidence)


def rest_findings(sensing: Sensing, counts: bool = False) -> tuple[Finding, ...]:
    """Return the findings of vertical, stationary periods and Earth rate.

    `counts` : whether the gyro's unit is unknown.
    """
    share = sensing.rest_s / sensing.length_s
    stationary = answer(
        "at rest",
        f"{sensing.rest_s:.0f} s",
        MOST_CONFIDENCE if share > 0.0 else 0.9,
        f"{share:.0%} of the recording, {len(sensing.stationary)} stationary periods",
    )
    if not sensing.rest_s:
        return (stationary,)
    axis = int(np.argmax(np.abs(sensing.mean_accel)))
    tilt_deg = float(np.degrees(np.arccos(abs(sensing.mean_accel[axis]) / sensing.gravity)))
    direction = "up" if sensing.mean_accel[axis] > 0.0 else "down"
    vertical = answer(
        "vertical axis",
        f"{'xyz'[axis]} {direction}",
        MOST_CONFIDENCE if tilt_deg < 30.0 else 0.6,
        f"{tilt_deg:.1f} deg off the vertical at rest",
    )
    if counts:
        return (
            stationary,
            vertical,
            unknown_property("Earth rate", "the unit of the gyros is not known"),
        )
    return stationary, vertical, _earth_rate_finding(sensing.mean_gyro, sensing)


def _earth_rate_finding(mean_gyro: Array, sensing: Sensing) -> Finding:
    """Return whether the mean rate at rest (3,), rad/s, shows the Earth's rotation."""
    rate = float(np.linalg.norm(mean_gyro))
    sigma = float(np.linalg.norm(sensing.rest_gyro)) / np.sqrt(sensing.rest_s)
    deg_h = np.degrees(3600.0)
    evidence = (
        f"mean rate at rest {rate * deg_h:.2f} +- {sigma * deg_h:.2g} deg/h; the Earth's rotation "
        f"is {EARTH_RATE * deg_h:.2f}"
    )
    if sensing.sees_earth:
        return answer(
            "Earth rate", "seen", 0.95, f"{evidence}: the heading can be determined at rest"
        )
    return answer(
        "Earth rate",
        "not seen",
        0.95,
        f"{evidence}: at rest only roll and pitch can be determined, not the heading",
    )
