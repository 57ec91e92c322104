"""Turns seen by the gyros, by GNSS and by the camera: they must be the same turns at the same time.

The course rate of GNSS is compared with the rate of turn about the vertical that the gyros see,
omega . d with d = -f/|f| smoothed over two seconds: in a coordinated turn with bank phi that is the
course rate times cos(phi), whatever the axes. Their regression gives the gyro unit, their sign
shows a mirrored frame (z up, latitude and longitude exchanged), the lag of their largest
correlation a time offset of the IMU. Who circles all the time has no changes to correlate: there
the rates themselves are compared, and no time offset is looked for.

A survey takes its images on lines: the course rate at the exposures is small. Where it is large,
but small 18 s earlier or later, the events are not in the time scale of the fixes. A camera that
takes images everywhere does not show that, and no camera shows errors of a second.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...base.findings.remedies import Remedy, SetKey, Step
from ...geodesy.gpstime import LEAP_NOW_S
from ...records import Array, CameraEvents, Finding, GnssFixes, ImuSamples, Question, Verdict
from ..prepare.fix_path import jumps, north_east, sound_fixes
from .relation import MAX_LAG_S, RIVAL_MISFIT_RATIO

OF_TURNS = "turn rate, gyro against GNSS course"  # name of the check (`records.verdicts`)
TURN_GRID_S = 0.1  # of the grid on which rates are compared (s): the epochs of usual receivers
SMOOTHED_TURNS_S = 2.0  # over which rates are smoothed (s): a turn takes longer, vibration does not
# a lag that is reported, where the correlation is clear enough for it
REPORTED_LAG_S, LAG_CORRELATION = 0.5, 0.9
# of what the turns leave unexplained at no lag, the most that a lag which is reported leaves
LAG_GAIN = 0.5
CLEAR_CORRELATION = 0.8  # of turns at another time, to take it for the right one
STRANGERS = (
    "IMU and GNSS show no common turn; check that both are of one flight and day, and clocks "
    "within 30 s"
)
NOSE = "the nose of the drone does not follow its course, so the turns do not show a time offset"
# confidence of the forces in all answers, by which they overrule the turns (chosen)
SURE_OF_FORCES = 0.99
# confidence of the forces in the clock, by which they overrule the turns' lag (chosen)
CLOCK_SURE = 0.9
AT_ONCE_S = 0.5  # time offset (s) up to which forces count as simultaneous: turns show no less
RIVAL_S = 5.0  # from the best lag: a correlation so far from it is a rival's
# correlations: from the first on the same turns are seen, below the second none of them
LEAST_TURN_CORRELATION, UNLIKE = 0.6, 0.3
BETTER = 0.15  # by which the correlation at another time must exceed that at no lag
# cosine of both rates as vectors: from here on a turn that never changes is most of what they show,
# and correlations about its mean tell nothing
STEADY_CORRELATION = 0.95
# correlation of the course rates of every other fix with those of the rest: below, they are noise
RELIABLE = 0.7
# of gyro to course rate: cos(bank) and noise stay within, no wrong unit does
RATE_RATIO = (0.4, 1.8)
UNIT_RATIO = (0.7, 1.4)  # of a ratio to that of a wrong unit
# of the grid at speed, and the course rate's standard deviation there, rad/s
LEAST_TURN_ROWS, LEAST_TURN_RATE = 100, 0.02
# rate of the IMU's clock that is looked for, its step (s of the flight: turns take longer), and of
# what turns leave unexplained at the best offset the most that a rate leaves (chosen)
MOST_RATE, RATE_STEP_S, RATE_GAIN = 0.15, 1.0, 0.4
RATE_CELLS, MOST_THINNED = 8000, 5  # cells of the grid that a rate needs; to 0.5 s at most
FASTEST_TURN = 1.5  # rad/s, of a course
# s: no other time scale is that near; exposures that would lie as straight there lie so by chance
NEARER_S, AS_STRAIGHT = 9.0, 2.0
LIKE_LEAP_S = (16.0, 20.0)  # a lag that looks like GPS against UTC
USUAL_COSINE = 0.92  # of the bank in a turn
# rad/s at the exposures, and how many times less it must be at the other time
TURNING_RATE, STRAIGHTER = 0.02, 4.0
# course rate (rad/s) from which an exposure is in a turn: 3 deg/s, ten times what wind and steering
# show on a line, a third of the slowest turn between lines
IN_TURN = 0.05
ENOUGH_IMAGES = 20  # whose mean rate of turn counts: fewer may all lie in turns by chance (chosen)
# of all squares: what rounding leaves of those of readings that do not vary
SQUARES_ROUNDING = 1e-12
# whose clock stamps the exposures, in words
CLOCK_OWNERS = {"imu": " of the IMU's clock", "receiver": " of the receiver's clock", "": ""}


def check_events(events: CameraEvents, gnss: GnssFixes, clock: str = "") -> Finding:
    """Check count and spacing of the exposures, and their time scale.

    The exposures contradict the fixes where they would lie on straighter lines in another time
    scale.

    Parameters
    ----------
    events : CameraEvents
    gnss : GnssFixes
    clock : {"imu", "receiver", ""}
        Whose clock stamps the exposures, as the finding says; "" where nobody said it.

    Returns
    -------
    Finding
    """
    ask = Question(
        "camera events", "in the time scale of the fixes: exposures on flight lines, not in turns"
    )
    step = np.diff(events.time)
    finding = f"{len(events.images)} images from {events.time[0]:.2f} to {events.time[-1]:.2f} s"
    finding += CLOCK_OWNERS[clock]
    if step.size:
        finding += f", shortest interval {step.min():.2f} s"
    grid = np.arange(gnss.time[0], gnss.time[-1], TURN_GRID_S)
    width = _width(gnss, grid)
    if len(events.images) < ENOUGH_IMAGES or grid.size < max(200, 5 * width):
        return ask.ok(finding)
    rate, moving = _course_rate(gnss, grid, width)
    here, *others = (
        _turning(events.time + s, grid, rate, moving) for s in (0.0, LEAP_NOW_S, -LEAP_NOW_S)
    )
    shifted = dict(zip((LEAP_NOW_S, -LEAP_NOW_S), others, strict=True))
    best = min(shifted, key=lambda s: shifted[s])
    straighter = np.isfinite(here) and here > TURNING_RATE and here > STRAIGHTER * shifted[best]
    if straighter and not _by_chance(events.time, shifted[best], grid, rate, moving):
        finding += (
            f"; mean course rate there {np.degrees(here):.1f} deg/s, {best:+.0f} s away"
            f" {np.degrees(shifted[best]):.1f} deg/s"
        )
        return ask.contradiction(finding, _other_scale(events, best))
    return ask.ok(finding)


def _other_scale(events: CameraEvents, offset: float) -> Remedy:
    """What to set for events that are on lines `offset` s later."""
    taken = {LEAP_NOW_S: ("gpst", "gps"), -LEAP_NOW_S: ("utc",)}[offset]
    if events.time_scale in taken:
        other = "utc" if offset == LEAP_NOW_S else "gpst"
        return Step(
            f"the events look like {other.upper()}, and were taken as {taken[0].upper()}: {{}}"
            " would put them on lines",
            SetKey("camera.time_scale", other),
        )
    return Step(
        "the events look like UTC or another clock: {} would put them on lines",
        SetKey("camera.time_offset_s", round(offset)),
    )


def exposures_off_lines(times: Sequence[Array], gnss: GnssFixes) -> list[int]:
    """Count the exposures where the course turns, and those before, after or between the fixes.

    Parameters
    ----------
    times : sequence of ndarray, s
        Times of the exposures, for each of which they are counted, in the week of the fixes.
    gnss : GnssFixes
    """
    grid = np.arange(gnss.time[0], gnss.time[-1], TURN_GRID_S)
    width = _width(gnss, grid)
    if grid.size < max(200, 5 * width):
        return [time.size for time in times]
    rate, moving = _course_rate(gnss, grid, width)
    located = [_cells(time, grid, moving) for time in times]
    return [int(np.sum(~usable | (np.abs(rate[k]) > IN_TURN))) for k, usable in located]


def exposure_ways(time: Array, gnss: GnssFixes) -> tuple[Array, NDArray[np.bool_]]:
    """Return the way from each exposure to the next, and where its course is known and straight.

    Parameters
    ----------
    time : ndarray, shape (n,), s
        Times of the exposures, in the week of the fixes.
    gnss : GnssFixes

    Returns
    -------
    tuple of ndarray
        Both (n - 1,): m, and bool.
    """
    position = np.column_stack([np.interp(time, gnss.time, axis) for axis in north_east(gnss).T])
    way = np.linalg.norm(np.diff(position, axis=0), axis=1)
    grid = np.arange(gnss.time[0], gnss.time[-1], TURN_GRID_S)
    width = _width(gnss, grid)
    if grid.size < max(200, 5 * width):
        return way, np.zeros(way.size, dtype=bool)
    rate, moving = _course_rate(gnss, grid, width)
    cells, usable = _cells(time, grid, moving)
    turning = np.cumsum(~moving | (np.abs(rate) > IN_TURN))
    return way, usable[1:] & usable[:-1] & (turning[cells[1:]] == turning[cells[:-1]])


def _by_chance(
    time: Array, straightest: float, grid: Array, rate: Array, moving: np.ndarray
) -> bool:
    """Whether the exposures would lie nearly as straight at a shift that is no time scale's.

    So it is where the course winds faster than leap seconds go by.
    """
    shifts = np.arange(-NEARER_S, NEARER_S + 0.5)
    return any(_turning(time + s, grid, rate, moving) < AS_STRAIGHT * straightest for s in shifts)


def _turning(time: Array, grid: Array, rate: Array, moving: np.ndarray) -> float:
    """Mean size of the course rate at `time`, rad/s; infinite where half of it is unknown."""
    cells, usable = _cells(time, grid, moving)
    return float(np.mean(np.abs(rate[cells[usable]]))) if usable.sum() > 0.5 * time.size else np.inf


def _cells(time: Array, grid: Array, moving: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Nearest cell of the grid for each time, and whether the course is known there."""
    cells = np.clip(np.rint((time - grid[0]) / TURN_GRID_S).astype(np.int64), 0, grid.size - 1)
    return cells, (time >= grid[0]) & (time <= grid[-1]) & moving[cells]


def _width(gnss: GnssFixes, grid: Array) -> int:
    """Number of steps to smooth over."""
    if gnss.time.size < 2:
        return grid.size
    return round(max(SMOOTHED_TURNS_S, 4.0 * float(np.median(np.diff(gnss.time)))) / TURN_GRID_S)


def quantity_guess(imu: ImuSamples, dt: float) -> tuple[float, SetKey]:
    """Factor by which readings are off where increments and rates are mixed up, and the remedy."""
    if imu.quantity == "increments":
        return 1.0 / dt, SetKey("imu.quantity", "mean_rate")
    return dt, SetKey("imu.quantity", "increments")


@dataclass(frozen=True)
class Forces:
    """What the forces that the IMU felt say of the record, against the motion that GNSS saw.

    Parameters
    ----------
    offset_s : float, s
        To be added to the GNSS stamps.
    sure_of_clock : float
        Confidence of the offset; 0 where the forces do not show it.
    sure_of_all : float
        Of unit, sense and clock together; 0 where one of them is not as the records have it.
    """

    offset_s: float = 0.0
    sure_of_clock: float = 0.0
    sure_of_all: float = 0.0


def check_turns(
    time: Array,
    rate: Array,
    force: Array,
    gnss: GnssFixes,
    imu: ImuSamples,
    dt: float,
    forces: Forces | None = None,
) -> Finding:
    """Check gyro unit, handedness and clock against the turns of the course.

    The check never contradicts what the forces show: there it abstains. A course is not a heading,
    and turns that repeat themselves fit at several lags.

    Parameters
    ----------
    time : ndarray, shape (k,), s
    rate : ndarray, shape (k, 3), rad/s
        In body axes.
    force : ndarray, shape (k, 3), m/s^2
        In body axes.
    gnss : GnssFixes
    imu : ImuSamples
    dt : float, s
        Interval of the IMU.
    forces : Forces, optional
        Where it is known already; else it is found where the turns contradict the records.

    Returns
    -------
    Finding
    """
    ask = Question(OF_TURNS, f"ratio {RATE_RATIO[0]:g} to {RATE_RATIO[1]:g} at no lag")
    grid = np.arange(max(time[0], gnss.time[0]), min(time[-1], gnss.time[-1]), TURN_GRID_S)
    width = _width(gnss, grid)
    if grid.size < max(200, 5 * width):
        return ask.note("too short or too few fixes to compare")
    course_rate, moving = _course_rate(gnss, grid, width)
    down = -np.column_stack([_smooth(force[:, c], width) for c in range(3)])
    down /= np.maximum(np.linalg.norm(down, axis=1, keepdims=True), 1e-9)
    turns = _smooth(np.sum(rate * down, axis=1), width)
    gyro = np.interp(grid, time, turns)
    if moving.sum() < LEAST_TURN_ROWS or np.std(course_rate[moving]) < LEAST_TURN_RATE:
        return ask.ok("no turns at speed to compare")
    lag, best, here, rival = _best_lag(gyro, course_rate, moving)
    common, squares = (float(np.sum(a[moving] * course_rate[moving])) for a in (gyro, course_rate))
    ratio = common / squares
    steady = abs(common) > STEADY_CORRELATION * np.sqrt(squares * float(np.sum(gyro[moving] ** 2)))
    finding = f"ratio {ratio:.3g}, correlation {here:.2f} at no offset, {best:.2f} at {lag:+.1f} s"
    spacing = float(np.median(np.diff(gnss.time)))
    if steady and abs(here) < LEAST_TURN_CORRELATION:
        here = best = float(np.sign(ratio))
        lag, finding = 0.0, f"ratio {ratio:.3g}, a turn that never changes"
    verdict, remedy, of_clock = _judge_turns(
        ratio, lag, best, here, imu, dt, max(REPORTED_LAG_S, spacing)
    )
    if abs(best) < LAG_CORRELATION or (of_clock and verdict == "contradiction"):
        evidence, of_rate = _judge_rate(time, turns, grid, course_rate, moving, best)
        if evidence:
            return ask.contradiction(f"{finding}; {evidence}", of_rate)
    if not remedy:
        return ask.answer(finding, verdict)
    forces = forces or _forces(imu, gnss)
    agree = forces.sure_of_all >= SURE_OF_FORCES and abs(forces.offset_s) <= AT_ONCE_S
    if agree and (verdict == "contradiction" or of_clock):
        finding += f"; but the forces agree at {forces.offset_s:+.3f} s"
        return ask.note(finding, NOSE)
    if of_clock and forces.sure_of_clock >= CLOCK_SURE and abs(forces.offset_s - lag) > AT_ONCE_S:
        finding += f"; but the forces show {forces.offset_s:+.3f} s"
        return ask.note(finding, NOSE)
    if of_clock and remedy != STRANGERS and 1.0 - rival**2 < RIVAL_MISFIT_RATIO * (1.0 - best**2):
        finding += f", and {rival:.2f} over {RIVAL_S:.0f} s from there"
        return ask.note(finding, "the turns repeat and do not show a time offset")
    if verdict == "contradiction" and not _reliable(gnss, grid, width):
        return ask.note(finding, "the fixes are too poor, or too few, to show turns")
    return ask.answer(finding, verdict, remedy)


def _reliable(gnss: GnssFixes, grid: Array, width: int) -> bool:
    """Whether every other fix shows the same turns as the rest."""
    (one, here), (other, there) = (_course_rate(gnss[first::2], grid, width) for first in (0, 1))
    both = here & there
    return both.sum() > 50 and float(np.corrcoef(one[both], other[both])[0, 1]) > RELIABLE


def _forces(imu: ImuSamples, gnss: GnssFixes) -> Forces:
    """What the forces show.

    A multirotor's course is not its heading. What it feels when it changes its velocity shows all
    the same whether the records fit.
    """
    from .recognition import recognise_liveliest

    recognition = recognise_liveliest(imu, gnss)
    clock = recognition.finding("time offset").confidence
    sure = min(recognition.finding(n).confidence for n in ("gyro unit", "gyro triad"))
    right = (
        recognition.finding("gyro triad").found == "aligned"
        and abs(np.log(recognition.gyro_factor)) < 1e-6
        and recognition.accel_sign > 0
    )
    return Forces(recognition.time_offset_s, clock, min(sure, clock) if right else 0.0)


def _judge_turns(
    ratio: float, lag: float, best: float, here: float, imu: ImuSamples, dt: float, least_lag: float
) -> tuple[Verdict, Remedy, bool]:
    """Verdict, remedy, and whether it is that of a clock.

    least_lag : s, the shortest lag that fixes so far apart can show; 1 - r^2 is what a correlation
    r leaves.
    """
    offset = f"IMU time is about {lag:+.1f} s off GNSS time"
    shift = f"add {lag:+.1f} s to {{gnss.time_offset_s}} or {-lag:+.1f} s to {{imu.time_offset_s}}"
    if (
        abs(best) > LEAST_TURN_CORRELATION
        and abs(lag) > max(1.0, least_lag)
        and abs(best) > abs(here) + BETTER
    ):
        if abs(lag) > MAX_LAG_S - 2.0 * TURN_GRID_S or abs(best) < CLEAR_CORRELATION:
            return "contradiction", STRANGERS, True
        like_leap = LIKE_LEAP_S[0] <= abs(lag) <= LIKE_LEAP_S[1]
        hint = "GPS against UTC (18 s)" if like_leap else "a wrong clock"
        return "contradiction", Step(f"{offset}: {hint}; {shift}"), True
    if abs(best) < UNLIKE:
        return "contradiction", STRANGERS, True
    if here < -LEAST_TURN_CORRELATION:
        remedy = Step(
            "the gyros turn the other way: {imu.axes} or gyro sign is wrong, or latitude and"
            " longitude are exchanged, or the sign of latitude or longitude is wrong"
        )
        return "contradiction", remedy, False
    if here > LEAST_TURN_CORRELATION and not RATE_RATIO[0] < ratio < RATE_RATIO[1]:
        return "contradiction", _gyro_unit_remedy(ratio, imu, dt), False
    explains = 1.0 - best**2 < LAG_GAIN * (1.0 - here**2)
    if best > LAG_CORRELATION and abs(lag) > least_lag + 0.5 * TURN_GRID_S and explains:
        return "note", Step(f"{offset}; {shift}"), True
    return ("ok" if here > LEAST_TURN_CORRELATION else "note"), "", False


def _judge_rate(
    time: Array, turns: Array, grid: Array, course_rate: Array, moving: np.ndarray, best: float
) -> tuple[str, Remedy]:
    """What shows that the IMU's clock runs at a rate 1 / a, and the remedy; empty where nothing."""
    thin = slice(None, None, max(1, min(grid.size // RATE_CELLS, MOST_THINNED)))
    grid, course_rate, moving = grid[thin], course_rate[thin], moving[thin]
    cell, middle = float(grid[1] - grid[0]), float(grid[grid.size // 2])
    most = int(min(MOST_RATE * grid.size, grid.size // 4))
    lags = np.arange(-most, most + 1)

    def likeness(a: float) -> tuple[float, float, float]:
        gyro = np.interp(grid, middle + a * (time - middle), turns, left=0.0, right=0.0)
        value = _correlations(gyro, course_rate, moving, lags)
        k = int(np.argmax(value))
        return float(value[k]), a, cell * float(lags[k])

    step = RATE_STEP_S / (grid[-1] - grid[0])
    coarse = max(map(likeness, 1.0 + np.arange(-MOST_RATE, MOST_RATE, step)))
    like, a, lag = max(map(likeness, coarse[1] + step * np.linspace(-1.0, 1.0, 21)))
    better = like > LAG_CORRELATION and 1.0 - like**2 < RATE_GAIN * (1.0 - best**2)
    if not better or abs(a - 1.0) < 2.0 * step:
        return "", ""
    share = f"{100.0 * abs(1.0 / a - 1.0):.2f} % {'fast' if a < 1.0 else 'slow'}"
    remedy = Step(
        f"the IMU's clock runs about {share}; "
        + "{} and {} would put its samples on that of the fixes",
        SetKey("imu.units time", f"{a:.6g} s"),
        SetKey("imu.time_offset_s", round((1.0 - a) * middle - lag, 2)),
    )
    return f"{like:.2f} at {a:.4f} times its time and {lag:+.1f} s", remedy


def _gyro_unit_remedy(ratio: float, imu: ImuSamples, dt: float) -> Remedy:
    """What the ratio looks like most."""
    ratio = max(ratio, 1e-12) / USUAL_COSINE
    key = "imu.units gyro"
    guesses = [
        (np.degrees(1.0), SetKey(key, "deg/s")),
        (np.radians(1.0), SetKey(key, "rad/s", "deg")),
        (np.radians(1.0) / 3600.0, SetKey(key, "rad/s", "deg/h")),
        (1.0 / 3600.0, SetKey(key, "deg/s", "deg/h")),
        quantity_guess(imu, dt),
    ]
    factor, remedy = min(guesses, key=lambda guess: abs(np.log(ratio / guess[0])))
    if UNIT_RATIO[0] < ratio / factor < UNIT_RATIO[1]:
        return Step("the gyro values look like {}", remedy)
    return Step("check {imu.units gyro} and {imu.quantity}")


def _course_rate(gnss: GnssFixes, grid: Array, width: int) -> tuple[Array, np.ndarray]:
    """Rate of the course on the grid, rad/s, and where speed and jumps of the fixes allow it."""
    sound = sound_fixes(gnss)
    time, ne = gnss.time[sound], north_east(gnss)[sound]
    position = np.column_stack([_smooth(np.interp(grid, time, ne[:, c]), width) for c in range(2)])
    velocity = np.gradient(position, grid, axis=0)
    acceleration = np.gradient(velocity, grid, axis=0)
    speed2 = np.sum(velocity**2, axis=1)
    across = velocity[:, 0] * acceleration[:, 1] - velocity[:, 1] * acceleration[:, 0]
    rate = _smooth(across / np.maximum(speed2, 1e-3), width)
    noise = float(np.median(np.sqrt(gnss.cov_ned[:, 0, 0])))
    slow = max(1.0, 3.0 * noise / (width * TURN_GRID_S))
    moving = _smooth((speed2 > slow**2).astype(float), 2 * width + 1) > 0.999
    moving[: 2 * width] = moving[-2 * width :] = False
    for k in jumps(time, ne):  # the smoothed course turns there as no vehicle did
        first, last = ((time[k - 1 : k + 1] - grid[0]) / TURN_GRID_S).astype(np.int64)
        moving[max(0, first - 2 * width) : max(0, last + 2 * width)] = False
    return rate, moving & (np.abs(rate) < FASTEST_TURN)


def _best_lag(
    gyro: Array, course_rate: Array, moving: np.ndarray
) -> tuple[float, float, float, float]:
    """Lag (s, positive: gyro late), correlation there, at no lag, and at best far from both.

    The sign is that of the correlation of largest size.
    """
    most = int(min(MAX_LAG_S / TURN_GRID_S, gyro.size // 4))
    lags = np.arange(-most, most + 1)
    value = _correlations(gyro, course_rate, moving, lags)
    best = int(np.argmax(np.abs(value)))
    far = np.abs(lags - lags[best]) * TURN_GRID_S > RIVAL_S
    rival = float(np.abs(value[far]).max(initial=0.0))
    return float(lags[best] * TURN_GRID_S), float(value[best]), float(value[most]), rival


def _correlations(a: Array, b: Array, use: np.ndarray, lags: np.ndarray) -> Array:
    """Correlation coefficients of a at i + lag with b at i, over the i that are in use.

    They are zero where there are 50 of these or fewer, or one of the two does not vary. Sums of
    products over all lags at once come from fast Fourier transforms, padded so that nothing wraps.
    """
    if not use.any():
        return np.zeros(lags.size)
    size = 1 << int(2 * a.size - 1).bit_length()
    a = a - a.mean()
    b = np.where(use, b - b[use].mean(), 0.0)
    first, end = np.maximum(-lags, 0), a.size - np.maximum(lags, 0)

    def summed(x: Array) -> Array:
        total = np.concatenate([[0.0], np.cumsum(x)])
        return np.asarray(total[end] - total[first])

    def products(x: Array, y: Array) -> Array:
        spectrum = np.fft.rfft(x, size) * np.conj(np.fft.rfft(y, size))
        return np.asarray(np.fft.irfft(spectrum, size)[lags])

    mask = use.astype(np.float64)
    count, b_sum, b_square = summed(mask), summed(b), summed(b * b)
    a_sum, a_square = products(a, mask), products(a * a, mask)
    n = np.maximum(count, 1.0)
    of_a, of_b = a_square - a_sum**2 / n, b_square - b_sum**2 / n
    varies = (of_a > SQUARES_ROUNDING * (a * a).sum()) & (of_b > SQUARES_ROUNDING * (b * b).sum())
    enough = (count > 50) & varies
    covariance = products(a, b) - a_sum * b_sum / n
    return np.where(enough, covariance / np.sqrt(np.where(enough, of_a * of_b, 1.0)), 0.0)


def _smooth(x: Array, width: int) -> Array:
    width = min(max(width, 1), x.size)
    return np.convolve(x, np.ones(width) / width, mode="same")
