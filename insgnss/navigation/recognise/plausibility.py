"""Plausibility: what the data show of units, axes and clocks, against the flight file.

A contradiction says what to change. Checks stand in the order in which to act on them: a dead
sensor or a single impossible reading upsets what is computed from it further down.
"""

import numpy as np

from ...base.findings.remedies import Remedy, SetKey, Step, join_remedies
from ...base.units import STANDARD_GRAVITY
from ...geodesy.axes import axes_words
from ...geodesy.earth import curvature_radii
from ...records import Array, CameraEvents, Finding, GnssFixes, ImuSamples, Question
from ...records.interpolation import columns_at
from ...records.verdicts import CHECKS
from ..prepare.fix_path import north_east, sound_fixes
from ..prepare.gaps import LEAST_GAP_INTERVALS, find_gaps, in_bunches, nominal_interval
from ..prepare.stuck_channels import CHANNEL_NAMES, STUCK_S, constant_runs, dead_band
from .positions import check_velocity
from .propulsion import propulsion
from .streams import check_classes
from .turns import TURN_GRID_S, Forces, check_events, check_turns, quantity_guess

# of a tangent plane's origin from the flight (m): a drone does not fly farther (chosen)
FARTHEST_ORIGIN_M = 50e3
HOVER_RADIUS_M = 10.0  # who stays within it may show the same rounded coordinate all the time
FAST_MS = 8.0  # from which on a course is near the heading (m/s): wind is mostly slower (chosen)
# resultant of the courses: nearly all within 20 deg; a multirotor may fly so with its nose anywhere
ONE_COURSE = 0.95
# rad/s, m/s^2: 5700 deg/s and 100 g, beyond every sensor on a drone
GYRO_LIMIT, ACCEL_LIMIT = 100.0, 1000.0
# heights (m) of drones: below every shore, above every mountain
LOWEST_M, HIGHEST_M = -1000.0, 10000.0
# m/s^2, the median of a flight's specific force: gravity, and what climbs and gusts add to it
FORCE = 8.8, 11.0
# what a turn adds to it, 1 / cos(bank), is taken off above: up to 70 deg of bank
MOST_LOAD = 3.0
SPEED_S = 2.0  # over which the speed is taken
GRAVITY_RATIO = (0.85, 1.15)  # of a norm to what gravity is in a wrong unit
# of the samples: more readings beyond any sensor are no spikes, but another unit or column
MOST_IMPLAUSIBLE_SHARE = 0.01


def check_recording(
    imu: ImuSamples,
    C_b_imu: Array,
    gnss: GnssFixes,
    events: CameraEvents | None,
    origin: Array | None,
    forces: Forces | None = None,
    event_clock: str = "",
) -> list[Finding]:
    """Make all checks that need no navigation solution.

    Parameters
    ----------
    imu : ImuSamples
    C_b_imu : ndarray, shape (3, 3)
        IMU axes to body, as the flight file has it.
    gnss : GnssFixes
    events : CameraEvents or None
    origin : ndarray, shape (3,), rad, rad, m, or None
        Origin of the tangent plane.
    forces : Forces, optional
        What the forces show, where it is known already.
    event_clock : {"imu", "receiver", ""}
        Whose clock stamps the events; "" where nobody said it.

    Returns
    -------
    list of Finding
        In the order of `CHECKS`.
    """
    dt = nominal_interval(imu.time)
    checks = [] if gnss.velocity_ned is None else [check_velocity(gnss)]
    checks += check_classes(gnss)
    checks += [_imu_rate(imu, dt), _silent(imu, dt), _readings(imu, dt)]
    checks += [_gnss_rate(gnss), _gnss_speed(gnss), _gnss_position(gnss)]
    if imu.time.size * dt > 2.0 * TURN_GRID_S:
        time, rate, force = _thin_to_grid(imu, C_b_imu, dt)
        load = _load(time, rate, gnss)
        checks += [_force_norm(rate, force, load, imu, dt), _down_axis(force, C_b_imu)]
        checks.append(check_turns(time, rate, force, gnss, imu, dt, forces))
    if origin is not None:
        checks.append(_origin_distance(gnss, origin))
    if events is not None:
        checks.append(check_events(events, gnss, event_clock))
    return sorted(checks, key=lambda check: list(CHECKS).index(check.name))


def check_heading(time: Array, C_nb: Array, velocity_ned: Array, C_b_imu: Array) -> Finding:
    """Check the smoothed heading against the course over ground while fast.

    A vehicle that leans to change its speed (`propulsion`) need not fly nose first.

    Parameters
    ----------
    time : ndarray, shape (n,), s
    C_nb : ndarray, shape (n, 3, 3)
        Body into north, east, down.
    velocity_ned : ndarray, shape (n, 3), m/s
    C_b_imu : ndarray, shape (3, 3)
        IMU axes to body, as the flight file has it.

    Returns
    -------
    Finding
    """
    ask = Question("heading against course", "median within 60 deg (a drone crabs in wind)")
    speed = np.hypot(velocity_ned[:, 0], velocity_ned[:, 1])
    fast = speed > FAST_MS
    if fast.sum() < 50:
        return ask.ok(f"never faster than {FAST_MS:.0f} m/s")
    course = np.arctan2(velocity_ned[fast, 1], velocity_ned[fast, 0])
    off = np.arctan2(C_nb[fast, 1, 0], C_nb[fast, 0, 0]) - course
    off = np.degrees(np.arctan2(np.sin(off), np.cos(off)))
    median = float(np.degrees(np.angle(np.mean(np.exp(1j * np.radians(off))))))
    scatter = float(np.median(np.abs((off - median + 180.0) % 360.0 - 180.0)))
    finding = f"median {median:.1f} deg, half of the values within {scatter:.1f} deg"
    if abs(np.mean(np.exp(1j * course))) > ONE_COURSE:
        return ask.note(
            f"{finding}, but a single course does not determine the axes",
            when=abs(median) > 30.0,
        )
    ahead = np.array([np.cos(np.radians(median)), -np.sin(np.radians(median)), 0.0])
    if abs(median) > 60.0 and _leans(time, C_nb, velocity_ned, ahead):
        return ask.note(
            f"{finding}; the drone leans to change its speed, like a multirotor, which may fly "
            "sideways or backwards"
        )
    if abs(median) > 60.0 and scatter < 30.0:
        quarter = round(median / 90.0)
        c, s = (1, 0, -1, 0)[quarter % 4], (0, 1, 0, -1)[quarter % 4]
        turned = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ C_b_imu
        advice = Step(
            f"{{imu.axes}} looks turned by {90 * quarter} deg about the vertical; if the drone"
            f" flies nose first it is {axes_words(turned)!r}"
        )
        return ask.contradiction(finding, advice)
    return ask.note(finding, when=abs(median) > 30.0)


def _leans(time: Array, C_nb: Array, velocity_ned: Array, ahead: Array) -> bool:
    """Whether the trajectory leans to change its speed along the body's axis `ahead` (3,)."""
    if time.size < 3:
        return False
    force = np.gradient(velocity_ned, time, axis=0) - [0.0, 0.0, STANDARD_GRAVITY]
    return propulsion(time, C_nb, force, ahead).leans


def _imu_rate(imu: ImuSamples, dt: float) -> Finding:
    gaps = find_gaps(imu.time, dt)
    longest = max((g[1] for g in gaps), default=0.0)
    ask = Question("IMU rate", "no interval over 1.5 nominal ones")
    span = float(imu.time[-1] - imu.time[0])
    finding = f"{1.0 / dt:.2f} Hz, {span:.1f} s, {imu.time.size} samples, {len(gaps)} gaps"
    if gaps:
        finding += f", longest {longest:.3f} s"
    if bunches := in_bunches(imu.time, dt):
        advice = (
            "time stamps come in bunches, rounded or from the logger; use the sensor's own clock"
        )
        return ask.contradiction(f"{finding}; {bunches}", advice)
    return ask.note(finding, when=gaps)


def _silent(imu: ImuSamples, dt: float) -> Finding:
    """Check for channels that repeat one value for longer than `STUCK_S`."""
    limit = max(int(STUCK_S / dt), 10)
    dead, band, how = [], [], ""
    for c, (name, column) in enumerate(
        zip(CHANNEL_NAMES, [*imu.gyro.T, *imu.accel.T], strict=True)
    ):
        runs = constant_runs(column, limit + 1)
        if not runs:
            continue
        first, last = max(runs, key=lambda run: run[1] - run[0])
        if c < 3 and all(dead_band(imu, c, *run) for run in runs):
            band.append(name)
            continue
        dead.append(name)
        length, begin = (last - first + 1) * dt, imu.time[first]
        how = how or f"stays at {column[first]:z.6g} for {length:.1f} s from {begin:.2f} s on"
    ask = Question("silent sensor", f"no channel constant for over {STUCK_S:.0f} s")
    if dead:
        finding = f"{dead[0]} {how}" + (f", likewise {', '.join(dead[1:])}" if dead[1:] else "")
        advice = Step("a sensor is dead or a column is wrong; check {imu.columns}")
        return ask.contradiction(finding, advice)
    finding = f"{', '.join(band)} read exactly 0 for a while"
    if band:
        return ask.note(finding, "a dead band hides slow turns and the bias")
    return ask.ok("every channel alive")


def _readings(imu: ImuSamples, dt: float) -> Finding:
    """Check for readings that no sensor can give: few are spikes, many are a wrong unit."""
    scale = 1.0 / dt if imu.quantity == "increments" else 1.0
    ask = Question("IMU readings", f"within {GYRO_LIMIT:.0f} rad/s and {ACCEL_LIMIT:.0f} m/s^2")
    findings, worst = [], 0
    for sensor, unit, values, limit in (
        ("gyro", "rad/s", imu.gyro, GYRO_LIMIT),
        ("accelerometer", "m/s^2", imu.accel, ACCEL_LIMIT),
    ):
        if max(values.max(), -values.min()) * scale <= limit:
            continue
        beyond = np.flatnonzero((np.abs(values) * scale > limit).any(axis=1))
        first = scale * values[beyond[0]]
        findings.append(
            f"{sensor} {first[np.argmax(np.abs(first))]:.4g} {unit} at {imu.time[beyond[0]]:.3f} s,"
            f" {beyond.size} such samples"
        )
        worst = max(worst, beyond.size)
    if not findings:
        return ask.ok("all within")
    advice: Remedy = (
        "spikes of the recording: correct them at their source, or cut them away with start_tow or"
        " end_tow"
    )
    if worst > MOST_IMPLAUSIBLE_SHARE * imu.time.size:
        advice = Step("check {imu.units} and {imu.columns}")
    return ask.contradiction("; ".join(findings), advice)


def _thin_to_grid(imu: ImuSamples, C_b_imu: Array, dt: float) -> tuple[Array, Array, Array]:
    """Time (k,), mean rate and specific force (k, 3) in body axes over `TURN_GRID_S`."""
    k = max(1, round(TURN_GRID_S / dt))
    n = imu.time.size // k
    scale = 1.0 / dt if imu.quantity == "increments" else 1.0
    # a product of matrices: numpy's mean over so few takes ten times as long
    mean = np.tile(scale / k * C_b_imu.T, (k, 1))
    gyro, accel = (x[: n * k].reshape(n, 3 * k) @ mean for x in (imu.gyro, imu.accel))
    return imu.time[: n * k].reshape(n, k).mean(axis=1), gyro, accel


def _load(time: Array, rate: Array, gnss: GnssFixes) -> Array:
    """The most that turns make of gravity, (k,): the root of 1 + (turn rate speed / g)^2.

    In a level turn with bank phi that is 1 / cos(phi); it is more where a vehicle turns its nose
    and not its course.
    """
    sound = sound_fixes(gnss)
    if sound.sum() < 2:
        return np.ones(time.size)
    ahead, behind = (
        columns_at(time + shift, gnss.time[sound], north_east(gnss)[sound])
        for shift in (0.5 * SPEED_S, -0.5 * SPEED_S)
    )
    across = np.linalg.norm(rate, axis=1) * np.linalg.norm(ahead - behind, axis=1) / SPEED_S
    load = np.sqrt(1.0 + (across / STANDARD_GRAVITY) ** 2)
    return np.asarray(np.minimum(load, MOST_LOAD))


def _force_norm(rate: Array, force: Array, load: Array, imu: ImuSamples, dt: float) -> Finding:
    ask = Question("specific force", f"median norm {FORCE[0]} to {FORCE[1]} m/s^2")
    norms = np.linalg.norm(force, axis=1)
    norm, level = float(np.median(norms)), float(np.median(norms / load))
    finding = f"median norm {norm:.4g} m/s^2"
    if norm > FORCE[1]:
        finding += f", {level:.4g} m/s^2 without what turns at that speed add"
    if norm >= FORCE[0] and level <= FORCE[1]:
        return ask.ok(finding)
    if norm < FORCE[0] <= np.median(np.linalg.norm(rate, axis=1)) <= FORCE[1]:
        exchanged = Step("gyro and accelerometer look exchanged; correct {imu.columns}")
        return ask.contradiction(finding, exchanged)
    key = "imu.units accel"
    guesses = [
        quantity_guess(imu, dt),  # said of all channels at once, a unit of one sensor alone
        (1.0 / STANDARD_GRAVITY, SetKey(key, "g")),
        (STANDARD_GRAVITY, SetKey(key, "m/s^2", "g")),
        (1e-3 * STANDARD_GRAVITY, SetKey(key, "m/s^2", "mg")),
        (1e3 / STANDARD_GRAVITY, SetKey(key, "mg")),
    ]
    close = [
        advice
        for factor, advice in guesses
        if GRAVITY_RATIO[0] < norm / STANDARD_GRAVITY / factor < GRAVITY_RATIO[1]
    ]
    advice = Step("check {imu.columns}, {imu.units} and {imu.quantity}")
    if close:
        advice = Step("the values look like {}", join_remedies(close))
    return ask.contradiction(finding, advice)


def _down_axis(force: Array, C_b_imu: Array) -> Finding:
    ask = Question(
        "axes, vertical", "specific force points up, along body -z, within 60 deg in the median"
    )
    up = np.median(force, axis=0)
    norm = np.linalg.norm(up)
    if norm == 0.0:
        return ask.contradiction("no specific force", Step("check {imu.columns}"))
    angle = float(np.degrees(np.arccos(np.clip(-up[2] / norm, -1.0, 1.0))))
    finding = (
        f"median ({up[0]:z.2f}, {up[1]:z.2f}, {up[2]:z.2f}) m/s^2 in body axes, {angle:.0f} deg"
        " off -z"
    )
    if angle > 60.0:
        in_imu = C_b_imu.T @ up
        axis = int(np.argmax(np.abs(in_imu)))
        sense, called = ("down", "up")[int(in_imu[axis] > 0)], axes_words(C_b_imu).split()[axis]
        advice = Step(
            f"the IMU's {'xyz'[axis]} axis points {sense}, {{imu.axes}} calls it {called!r};"
            " correct {imu.axes}"
        )
        return ask.contradiction(finding, advice)
    return ask.note(finding, when=angle > 30.0)


def _gnss_rate(gnss: GnssFixes) -> Finding:
    ask, step = Question("GNSS rate", "no interval over 1.5 nominal ones"), np.diff(gnss.time)
    if not step.size:
        return ask.note("a single fix")
    nominal = float(np.median(step))
    gaps = step > LEAST_GAP_INTERVALS * nominal
    finding = f"{1.0 / nominal:.2f} Hz, {gnss.time.size} fixes, {int(gaps.sum())} gaps"
    if gaps.any():
        finding += f", longest {step.max():.1f} s"
    return ask.note(finding, when=gaps.any())


def _gnss_speed(gnss: GnssFixes) -> Finding:
    ask = Question("GNSS speed", "below 100 m/s")
    if gnss.time.size < 2:
        return ask.note("a single fix")
    step = np.maximum(np.diff(gnss.time), 1e-3)
    noise = np.sqrt(np.trace(gnss.cov_ned, axis1=1, axis2=2))
    distance = np.linalg.norm(np.diff(north_east(gnss), axis=0), axis=1)
    speed = np.maximum(distance - 5.0 * (noise[1:] + noise[:-1]), 0.0) / step
    typical = float(np.median(speed))
    fast = int((speed > 100.0).sum())
    finding = f"median {np.median(distance / step):.1f} m/s, {fast} steps over 100 m/s"
    if typical > 100.0:
        return ask.contradiction(
            finding, "check the columns, angle units and time unit of the GNSS file"
        )
    return ask.note(finding, when=fast)


def _gnss_position(gnss: GnssFixes) -> Finding:
    """Units and columns of the positions, from where on Earth they lie."""
    ask = Question(
        "GNSS position",
        f"away from 0, 0 deg, {LOWEST_M:.0f} to {HIGHEST_M:.0f} m high, changing from fix to fix",
    )
    lat, lon, height = np.degrees(gnss.lat[0]), np.degrees(gnss.lon[0]), float(gnss.height[0])
    finding = f"first fix at {lat:.5f}, {lon:.5f} deg, {height:.1f} m"
    largest = np.degrees([np.abs(gnss.lat).max(), np.abs(gnss.lon).max()])
    if (largest <= np.pi).all():  # nothing but sea, in either order of radians read as degrees
        exchanged = ", latitude and longitude exchanged," if largest[0] > 0.5 * np.pi else ""
        advice = Step(
            "the position is in the Gulf of Guinea: values look like radians ({}){} or are zeros",
            *(SetKey("gnss.units", {"angle": "rad"}), exchanged),
        )
        return ask.contradiction(finding, advice)
    beyond = np.flatnonzero((gnss.height < LOWEST_M) | (gnss.height > HIGHEST_M))
    if beyond.size:
        outlying = (
            f"; height {gnss.height[beyond[0]]:.1f} m at {gnss.time[beyond[0]]:.1f} s,"
            f" {beyond.size} such fixes"
        )
        return ask.contradiction(
            finding + outlying, Step("check {gnss.columns} and the unit of the heights, which is m")
        )
    columns = {"latitude": gnss.lat, "longitude": gnss.lon, "height": gnss.height}
    constant = [name for name, column in columns.items() if np.ptp(column) == 0.0]
    if constant and gnss.time.size > 10:
        coordinate = " and ".join(constant)
        finding += f", {coordinate} the same in all {gnss.time.size} fixes"
        advice = Step(f"{coordinate} must change; check {{gnss.columns}}")
        near = np.ptp(north_east(gnss), axis=0).max() < HOVER_RADIUS_M
        if near and len(constant) < len(columns):  # it hovers, and has too few digits
            return ask.note(finding, advice)
        return ask.contradiction(finding, advice)
    return ask.ok(finding)


def _origin_distance(gnss: GnssFixes, origin: Array) -> Finding:
    ask = Question("tangent plane origin", f"within {FARTHEST_ORIGIN_M / 1e3:.0f} km of the flight")
    distance = _metres_from(origin, gnss.lat[0], gnss.lon[0])
    finding = (
        f"first fix at {np.degrees(gnss.lat[0]):.5f}, {np.degrees(gnss.lon[0]):.5f} deg,"
        f" {distance / 1e3:.1f} km from the origin"
    )
    if distance > FARTHEST_ORIGIN_M:
        advice = Step("correct tangent_plane.origin or the GNSS columns")
        if _metres_from(origin, gnss.lon[0], gnss.lat[0]) < FARTHEST_ORIGIN_M:
            exchanged = "latitude and longitude look exchanged"
            advice = Step(f"{exchanged}; correct {{gnss.columns}} or tangent_plane.origin")
        return ask.contradiction(finding, advice)
    return ask.ok(finding)


def _metres_from(origin: Array, lat: float, lon: float) -> float:
    """Return how far a place lies from the origin of a tangent plane, horizontally, m."""
    M, N = curvature_radii(origin[0])
    north, east = (lat - origin[0]) * M, (lon - origin[1]) * N * np.cos(origin[0])
    return float(np.hypot(north, east))
