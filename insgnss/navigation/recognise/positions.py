"""Positions against the velocities beside them: wrong units, orders and signs of either.

A displacement over some seconds, by its time, is the mean velocity over them, whatever the axes and
units of the IMU. Where it is not, every misreading that files are known for is tried on the same
rows, and the one that makes displacements and velocities equal is named:

    off = median |displacement / time - velocity| / median |velocity|                         (R.11)

over the faster half of the rows. As read, right columns leave the noise of the fixes, some percent
of a drone's speed. A misreading is named where it explains what the columns as read do not
(`insgnss/geodesy/explain.py`), else the check abstains: velocities that are wrong in themselves
contradict positions that are right.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...base.findings.remedies import Remedy, SetKey, Step, join_remedies
from ...base.units import DEG
from ...geodesy.explain import Candidate, explain
from ...records import Array, Finding, GnssFixes, Question
from ...records.observations import UNKNOWN_MPS
from ..prepare.fix_path import north_east

VELOCITY_CHECK = "GNSS velocity"
SPAN_S = 2.0  # of a displacement: a latency of some tenths between the two does not show
LEAST_DISPLACEMENTS = 30  # displacements whose median counts (chosen)
# speed (m/s) below which the noise of fixes hides a displacement of 2 s (chosen)
LEAST_SPEED_MPS = 1.0
MOST_SIGMAS = 3.0  # of a displacement's noise: a larger one is of a motion (chosen)
CLIMB_MPS = 0.3  # a vertical velocity that tells its sense
AGREE, GOOD = 0.25, 0.2  # largest (R.11) of columns as read that are right, and of a misreading
REVERSED = -0.7  # correlation of heights and vertical velocity that tells the other sense
VELOCITY_UNITS = {"km/h": 1.0 / 3.6, "kn": 1852.0 / 3600.0, "cm/s": 1e-2, "mm/s": 1e-3}


Pairs = tuple[NDArray[np.intp], NDArray[np.intp]]
Motion = tuple[Array, Array]  # displacements by time, and mean velocities, m/s


def check_velocity(gnss: GnssFixes) -> Finding:
    """Check the positions against the velocities of the same fixes.

    Parameters
    ----------
    gnss : GnssFixes
        With velocities.

    Returns
    -------
    Finding
        A contradiction names the misreading; a note says that nothing explains the difference.
    """
    expected = f"displacements are the velocity times the time, within {AGREE:.0%} in the median"
    ask = Question(VELOCITY_CHECK, expected)
    assert gnss.velocity_ned is not None
    assert gnss.velocity_cov_ned is not None
    pairs = _pairs(gnss.time)
    if pairs is None:
        return ask.ok("too few fixes to compare displacements with")
    mean = _mean_velocity(gnss.time, gnss.velocity_ned, pairs)
    rows = _fast(mean[:, :2], LEAST_SPEED_MPS)
    moved = _mean_velocities(gnss, pairs)
    advice = Step(
        "positions or velocities are wrong; check {gnss.columns} and units, or leave velocities out"
    )
    if rows.sum() < LEAST_DISPLACEMENTS:
        between = float(np.median(np.hypot(*(moved - mean)[:, :2].T)))
        scatter = float(np.median(gnss.cov_ned[:, 0, 0] + gnss.cov_ned[:, 1, 1]))
        if between > LEAST_SPEED_MPS + MOST_SIGMAS * np.sqrt(2.0 * scatter) / SPAN_S:
            finding = f"velocities are below {LEAST_SPEED_MPS:g} m/s where the positions move"
            return ask.note(f"{finding} by another {between:.1f} m/s in the median", advice)
        return ask.ok(f"never faster than {LEAST_SPEED_MPS:g} m/s for long")
    off_share = _off(moved[rows, :2], mean[rows, :2])
    finding = f"displacements are {off_share:.0%} off the velocities in the median"
    if off_share > AGREE:
        ways = list(_misreadings(gnss, pairs))
        explanation = explain(
            (moved, mean),
            [Candidate(str(k), read) for k, (_, read) in enumerate(ways)],
            lambda motion: _off(motion[0][rows, :2], motion[1][rows, :2]),
            GOOD,
            AGREE,
        )
        if explanation is not None:
            close = [ways[int(one.statement)][0] for one in (explanation.best, *explanation.alike)]
            return ask.contradiction(finding, join_remedies(close))
        return ask.note(finding, advice)
    measured = gnss.velocity_cov_ned[:, 2, 2].min() < 0.5 * UNKNOWN_MPS**2
    climbs = _fast(mean[:, 2:], CLIMB_MPS)
    if measured and climbs.sum() >= LEAST_DISPLACEMENTS:
        down, stated = moved[climbs, 2:], mean[climbs, 2:]
        if np.corrcoef(down[:, 0], stated[:, 0])[0, 1] < REVERSED:
            finding = "the heights rise where the vertical velocity falls"
            advice = Step(
                "the vertical velocity has the opposite sign: in {gnss.columns} call it vu"
                " instead of vd, or vd instead of vu"
            )
            return ask.contradiction(finding, advice)
    return ask.ok(finding)


def _misreadings(
    gnss: GnssFixes, pairs: Pairs
) -> Iterator[tuple[Remedy, Callable[[Motion], Motion]]]:
    """What files are known for: what to do, and the data read so."""
    exchange = Step("latitude and longitude are exchanged: exchange their names in {gnss.columns}")
    radians, degrees = (
        Step(
            f"latitude and longitude are in {name}: set {{}}", SetKey("gnss.units", {"angle": unit})
        )
        for name, unit in (("radians", "rad"), ("degrees", "deg"))
    )

    def placed(lat: Array, lon: Array) -> Callable[[Motion], Motion]:
        return lambda motion: (_mean_velocities(replace(gnss, lat=lat, lon=lon), pairs), motion[1])

    def moving(factor: float) -> Callable[[Motion], Motion]:
        return lambda motion: (motion[0], factor * motion[1])

    places: list[tuple[Remedy, Array, Array]] = [
        (exchange, gnss.lon, gnss.lat),
        (radians, gnss.lat / DEG, gnss.lon / DEG),
        (join_remedies((radians, exchange), "; and "), gnss.lon / DEG, gnss.lat / DEG),
        (degrees, gnss.lat * DEG, gnss.lon * DEG),
        ("the sign of the latitude is wrong", -gnss.lat, gnss.lon),
        ("the sign of the longitude is wrong", gnss.lat, -gnss.lon),
    ]
    for advice, lat, lon in places:
        if np.abs(lat).max() <= 0.5 * np.pi and np.abs(lon).max() <= 2.0 * np.pi:
            yield advice, placed(lat, lon)
    for unit, factor in VELOCITY_UNITS.items():
        remedy = SetKey("gnss.units", {"velocity": unit})
        yield Step(f"the velocities are in {unit}: set {{}}", remedy), moving(factor)
    crossed = Step("vn and ve are exchanged: exchange their names in {gnss.columns}")
    yield crossed, lambda motion: (motion[0], motion[1][:, [1, 0, 2]])


def _pairs(time: Array) -> Pairs | None:
    """First and last row of displacements over about `SPAN_S`; None with too few fixes."""
    if time.size < LEAST_DISPLACEMENTS:
        return None
    step = float(np.median(np.diff(time)))
    k = max(1, round(SPAN_S / max(step, 1e-3)))
    first = np.arange(time.size - k, dtype=np.intp)
    whole = time[first + k] - time[first] < 1.5 * k * step
    return (first[whole], first[whole] + k) if whole.sum() >= LEAST_DISPLACEMENTS else None


def _mean_velocity(time: Array, velocity: Array, pairs: Pairs) -> Array:
    """Mean velocity (m, 3) between the rows of each pair."""
    step = np.diff(time)[:, None]
    along = 0.5 * step * (velocity[1:] + velocity[:-1])
    way = np.concatenate([np.zeros((1, 3)), np.cumsum(along, axis=0)])
    first, last = pairs
    return np.asarray((way[last] - way[first]) / (time[last] - time[first])[:, None])


def _mean_velocities(gnss: GnssFixes, pairs: Pairs) -> Array:
    """Displacement by time (m, 3), m/s, north, east, down."""
    first, last = pairs
    p = np.column_stack([north_east(gnss), -gnss.height])
    return np.asarray((p[last] - p[first]) / (gnss.time[last] - gnss.time[first])[:, None])


def _fast(velocity: Array, least: float) -> Array:
    """The faster half of the rows, if they are faster than `least`."""
    speed = np.linalg.norm(velocity, axis=1)
    return np.asarray(speed > max(least, float(np.median(speed))))


def _off(displaced: Array, velocity: Array) -> float:
    """How far displacements are off the velocities (R.11)."""
    median_difference = np.median(np.linalg.norm(displaced - velocity, axis=1))
    return float(median_difference / np.median(np.linalg.norm(velocity, axis=1)))
