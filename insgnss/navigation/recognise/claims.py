"""The flight file's claims of units, axes, sign and clock against what the data show of themselves.

A contradiction says what would put the claim right; the exchange of two axes was tried before it is
advised (`handedness`).

A clock that was set ahead in flight shows in its stamps as a pause. A pause of the recording leaves
the motion that GNSS saw where the stamps have it. Where a clock was set ahead by s, the pause is s
and an interval long, and the samples of both sides together explain that motion once the pause is
closed, and neither with the pause nor with another part of it closed.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ...base.findings.remedies import Remedy, SetKey, Step, join_remedies
from ...geodesy.axes import axes_words
from ...geodesy.gpstime import WEEK_S, weeks_apart
from ...records import Array, Finding, GnssFixes, ImuSamples, Question
from ..prepare.gaps import find_gaps, nominal_interval
from .axes import imu_word
from .handedness import LEFT_HANDED, SURE_OF_EXCHANGE, of_axes, what_is_wrong
from .recognition import EXCHANGED_ADVICE, LOOKED_AT_S, Recognition, recognise, recognise_between
from .turns import OF_TURNS
from .units import ACCEL_UNITS, GYRO_UNITS

INCREMENT_UNITS = {"gyro": {"rad": 1.0, "deg": np.pi / 180.0}, "accel": {"m/s": 1.0}}
RATE_UNITS = {"gyro": GYRO_UNITS, "accel": ACCEL_UNITS}
REPORTED_OFFSET_S = 0.02  # a time offset that is reported
# a time offset that stops the job; below it the filter copes, and a note reports it
OFFSET_LIMIT_S = 0.5
RECOGNISED = tuple(f"recognised {kind}" for kind in ("units", "axes", "sign", "clock"))
MOST_PAUSES = 3  # of a recording, the longest, that are looked at: each takes a second
OTHER_S = 5.0  # by which another closing differs, s, or half of the pause: turns take as long
# times that the right closing leaves less unexplained than any other; a pause that was one leaves
# more, not less (chosen)
CLEARLY = 1.5
# Hz: counters of oscillators that loggers write as stamps: powers of two (watch crystals), sensor
# times of Bosch (39.0625 us) and 32 us, 16 us timers, DJI, Qualcomm's and Arm's generic timers
COUNTERS_HZ = (*(float(2**k) for k in range(8, 25)), 25600.0, 31250.0, 62500.0, 4.5e6, 19.2e6, 24e6)
# ratio: the samples may last so many times longer or shorter than the fixes in the right tick
LENGTHS_APART = 2.5
# times that the right tick leaves less unexplained than the claimed one, and share of the motion
# that it may leave: a tick 2 % off leaves 200 times as much, a tenth (measured on four minutes)
CLEARLY_TICKS, MOST_OF_TICKS = 2.0, 0.1
# of the motion that GNSS saw: a clock that leaves less unexplained is right to 0.5 % (measured)
EXPLAINED_SHARE = 0.03
Exchange = Callable[[tuple[int, int]], Remedy]


def exchange_in_words(pair: tuple[int, int]) -> Remedy:
    """Say how to exchange two axes in a flight file whose columns are not known."""
    a, b = ("xyz"[k] for k in pair)
    return Step(f"exchange the names g{a} and g{b}, and a{a} and a{b}, in {{imu.columns}}")


def compare(
    recognition: Recognition,
    C_b_imu: Array,
    *,
    quantity: str = "mean_rate",
    gyro_unit: str = "rad/s",
    accel_unit: str = "m/s^2",
    accel_sign: int = 1,
    time_offset_s: float = 0.0,
    remedy: Exchange = exchange_in_words,
) -> list[Finding]:
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
    remedy : callable
        Returns how to exchange two axes in gyros and accelerometers alike.

    Returns
    -------
    list of Finding
        Those of `RECOGNISED`: "contradiction" where the data are surer than `SURE_OF_EXCHANGE` of
        something else (of a clock: by more than `OFFSET_LIMIT_S`), "note" where they do not
        determine it or are less sure, "ok" otherwise.
    """
    return [
        _compare_units(recognition, quantity, gyro_unit, accel_unit),
        _compare_axes(recognition, C_b_imu, accel_sign, remedy),
        _compare_sign(recognition, accel_sign),
        _compare_clock(recognition, time_offset_s),
    ]


def _compare_units(
    recognition: Recognition, quantity: str, gyro_unit: str, accel_unit: str
) -> Finding:
    """Compare the units. A factor other than 1 shows by what the claim is wrong."""
    ask = Question(
        "recognised units", f"gyro in {gyro_unit}, accelerometer in {accel_unit}, {quantity}"
    )
    sensors = (
        ("gyro", recognition.finding("gyro unit"), recognition.gyro_factor, gyro_unit),
        ("accel", recognition.finding("accelerometer unit"), recognition.accel_factor, accel_unit),
    )
    wrong_quantity = (quantity == "increments") != (recognition.quantity == "increments")
    remedies: list[Remedy] = []
    sure, evidence = 1.0, []
    for sensor, finding, factor, claimed in sensors:
        evidence.append(f"{finding.name} {finding.found}: {finding.evidence}")
        if not finding.confidence or (abs(np.log(factor)) < 1e-6 and not wrong_quantity):
            continue
        units = RATE_UNITS[sensor] | INCREMENT_UNITS[sensor]
        true = factor * units[claimed]
        of_quantity = INCREMENT_UNITS[sensor] if recognition.quantity == "increments" else units
        unit = next((u for u, f in of_quantity.items() if abs(np.log(true / f)) < 1e-6), None)
        key = f"imu.units {sensor}"
        by_factor = Step(f"the numbers are off by {factor:.4g}, check {{{key}}}")
        remedies.append(Step("the numbers look like {}", SetKey(key, unit)) if unit else by_factor)
        sure = min(sure, finding.confidence)
    if wrong_quantity and recognition.finding("quantity").confidence:
        quantity_of = SetKey("imu.quantity", recognition.quantity)
        remedies.append(Step("they look like {}", quantity_of))
    if remedies:
        return ask.against(
            "; ".join(evidence), join_remedies(remedies, "; "), sure > SURE_OF_EXCHANGE
        )
    silent = [finding.name for _, finding, *_ in sensors if not finding.confidence]
    return ask.note(
        "; ".join(evidence), f"the data do not determine the {' and '.join(silent)}", when=silent
    )


def _compare_axes(
    recognition: Recognition, C_b_imu: Array, accel_sign: int, remedy: Exchange
) -> Finding:
    """Compare the orientation where it is known, else its vertical axis, else the gyros' sense."""
    claimed = axes_words(C_b_imu)
    ask = Question("recognised axes", claimed)
    finding, vertical, triads = (
        recognition.finding(n) for n in ("axes", "vertical axis", "gyro triad")
    )
    if recognition.exchanges:
        return _left_handed(recognition, C_b_imu, accel_sign, remedy)
    if triads.found not in ("aligned", "unknown"):
        advice = Step(
            f"about the accelerometers' x y z turn {triads.found}: correct {{imu.columns}} or the"
            " signs in the file"
        )
        return ask.against(
            f"{triads.found}; {triads.evidence}", advice, triads.confidence > SURE_OF_EXCHANGE
        )
    statement = f"{recognition.axes or 'unknown'} ({finding.evidence})"
    if recognition.axes == claimed:
        return ask.ok(statement)
    if vertical.confidence > SURE_OF_EXCHANGE and recognition.down != imu_word(C_b_imu[2]):
        hint: Remedy = Step(f"{{imu.axes}} must have the IMU's {recognition.down} down")
        if recognition.axes:
            hint = SetKey("imu.axes", recognition.axes)
        return ask.contradiction(statement, Step("the data look like {}", hint))
    if recognition.axes is None:
        return ask.note(
            statement,
            Step(
                "nothing to do if {imu.axes} was read off the sensor: motion does not show the "
                "forward axis"
            ),
        )
    sure = finding.confidence > SURE_OF_EXCHANGE
    axes = SetKey("imu.axes", recognition.axes)
    if sure:
        return ask.contradiction(statement, Step("the data look like {}", axes))
    advice = Step(
        "if the drone flew nose first, set {}, since all images are turned now; if it flew "
        "sideways or backwards, do nothing",
        axes,
    )
    return ask.note(statement, advice)


def _left_handed(
    recognition: Recognition, C_b_imu: Array, accel_sign: int, remedy: Exchange
) -> Finding:
    """Name the exchange of two axes that was tried and explains the motion, and its remedy."""
    claimed = axes_words(C_b_imu)
    exchange = of_axes(recognition.exchanges, C_b_imu)
    sign = Step(", and {}", SetKey("imu.accel_sign", 1)) if accel_sign < 0 else ""
    if exchange is not None:
        a, b = exchange.words
        error = f"{a} and {b} are exchanged in gyro and accelerometer alike"
        axes: Remedy = ""
    else:
        exchange = recognition.exchanges[0]
        a, b = exchange.words
        error, trial = what_is_wrong(exchange, C_b_imu), exchange.recognition
        vertical = trial.finding("vertical axis").found
        lie = ", and the words of {imu.axes} by how the exchanged axes lie, the IMU's {}"
        axes = Step(lie, vertical)
        if trial.axes:
            axes = Step(", with {}", SetKey("imu.axes", trial.axes))
        if error != LEFT_HANDED:
            axes = Step("{}; or correct the signs in the file", axes)
    triads = exchange.recognition.finding("gyro triad")
    finding = f"{error}: with {a} and {b} exchanged {triads.evidence}"
    sure = recognition.finding("gyro triad").confidence > SURE_OF_EXCHANGE
    advice = join_remedies((remedy(exchange.pair), sign, axes), "")
    return Question("recognised axes", f"{claimed}, right-handed").against(finding, advice, sure)


def _compare_sign(recognition: Recognition, accel_sign: int) -> Finding:
    finding, claim = recognition.finding("force sign"), ", with the sign of the claim"
    ask = Question("recognised sign", f"specific force (up at rest){claim * (accel_sign < 0)}")
    statement = f"{finding.found}: {finding.evidence}"
    if recognition.exchanged:
        return ask.contradiction(statement, EXCHANGED_ADVICE)
    if not finding.confidence:
        return ask.note(statement, "the data do not show whether the accelerometers are reversed")
    if recognition.exchanges:  # as mirrored readings have it: no sign of the force's own
        return ask.note(statement, "caused by the left-handed axes alone; see recognised axes")
    if recognition.accel_sign > 0:
        return ask.ok(statement)
    advice = Step(
        "the accelerometers report the reversed specific force: {}; or latitude and longitude are "
        "exchanged, or one has the wrong sign",
        SetKey("imu.accel_sign", -accel_sign),
    )
    return ask.against(statement, advice, finding.confidence > SURE_OF_EXCHANGE)


def _compare_clock(recognition: Recognition, time_offset_s: float) -> Finding:
    finding = recognition.finding("time offset")
    ask = Question("recognised clock", f"GNSS on the IMU's clock within {OFFSET_LIMIT_S} s")
    statement = f"{finding.found}: {finding.evidence}"
    if not finding.confidence:
        return ask.note(statement, "the data do not determine the time offset")
    offset, sigma = recognition.time_offset_s, recognition.time_offset_sigma_s
    if abs(offset) < max(3.0 * sigma, REPORTED_OFFSET_S):
        return ask.ok(statement)
    set_to = SetKey("gnss.time_offset_s", round(time_offset_s + offset, 3))
    advice = Step("{} would bring the fixes to the IMU's clock", set_to)
    if weeks := weeks_apart(offset):
        sense = "behind" if offset > 0.0 else "ahead of"
        statement = f"the fixes are {weeks} {sense} the IMU: {statement}"
        whole = time_offset_s + WEEK_S * round(offset / WEEK_S)
        advice = Step(
            "IMU and fixes have times of different weeks; give both in one week, such as by {}",
            SetKey("gnss.time_offset_s", round(whole, 1)),
        )
    if recognition.time_scale in ("GNSS in UTC", "IMU in UTC"):
        advice = Step("{} ({}, leap seconds)", advice, recognition.time_scale)
    sure = abs(offset) > OFFSET_LIMIT_S and finding.confidence > SURE_OF_EXCHANGE
    return ask.against(statement, advice, sure)


def with_set_clock(checks: list[Finding], imu: ImuSamples, gnss: GnssFixes) -> list[Finding]:
    """Return checks of a recording with that of a clock that was set, instead of the turns'."""
    set_clock = check_set_clock(imu, gnss)
    if set_clock is None:
        return checks
    return [set_clock, *(check for check in checks if check.name != OF_TURNS)]


def check_set_clock(imu: ImuSamples, gnss: GnssFixes) -> Finding | None:
    """Look for a clock of the IMU that was set ahead in a pause of its stamps.

    Parameters
    ----------
    imu : ImuSamples
    gnss : GnssFixes

    Returns
    -------
    Finding or None
        A contradiction with the name of the clock's check; None where no clock was set.
    """
    interval = nominal_interval(imu.time)
    pauses = [gap for gap in find_gaps(imu.time, interval) if gap[1] > OFFSET_LIMIT_S]
    for start, length in sorted(pauses, key=lambda gap: -gap[1])[:MOST_PAUSES]:
        row, step = int(np.searchsorted(imu.time, start, side="right")), length - interval
        common = imu.time[row] < gnss.time[-1] and imu.time[row - 1] > gnss.time[0]
        # samples apart from all fixes leave nothing unexplained: another closing has to
        controls = (0.0,) if common else (0.0, step - min(OTHER_S, 0.5 * step))
        closings = []
        for rows, instant, sign in (("after", start, -1.0), ("up to", start + length, 1.0)):
            side = slice(row, None) if rows == "after" else slice(row)
            (misfit, offset), *of_controls = (
                _misfit(_move_stamps(imu, side, sign * by), gnss, instant)
                for by in (step, *controls)
            )
            if misfit < of_controls[0][0] and CLEARLY * misfit < of_controls[-1][0]:
                closings.append((abs(offset), rows, sign * step, misfit, of_controls[0][0]))
        if not closings:
            continue
        _, rows, added, misfit, paused = min(closings)
        return Question(
            "recognised clock", "a clock that is not set during the recording"
        ).contradiction(
            f"the IMU's clock was set by {step:+.3f} s between {start:.3f} and"
            f" {start + length:.3f} s, its samples {row} and {row + 1}: with this jump removed"
            f" the IMU explains {1.0 - misfit:.1%} of the motion that GNSS saw, with it"
            f" {1.0 - paused:.1%} at most",
            Step(
                f"add {added:+.3f} s to the stamps {rows} there, and to events of the same clock;"
                " no single time offset mends it"
            ),
        )
    return None


def with_ticks(
    checks: list[Finding], imu: ImuSamples, gnss: GnssFixes, unit_s: float
) -> list[Finding]:
    """Return checks with that of the ticks of the IMU's stamps instead of contradicted turns.

    Parameters
    ----------
    checks : list of Finding
    imu : ImuSamples
    gnss : GnssFixes
    unit_s : float, s
        What the flight file says that one count of the stamps is.
    """
    if not any(check.name == OF_TURNS and check.verdict == "contradiction" for check in checks):
        return checks
    counter = ticks_of_counter(imu, gnss, unit_s, recognise(imu, gnss))
    if counter is None:
        return checks
    hertz, evidence = counter
    of_ticks = Question("recognised clock", f"stamps that count {unit_s:g} s").contradiction(
        evidence, Step("{}", SetKey("imu.units time", f"{1e6 / hertz:.12g} us"))
    )
    return [of_ticks, *(check for check in checks if check.name != OF_TURNS)]


def ticks_of_counter(
    imu: ImuSamples, gnss: GnssFixes, unit_s: float, recognition: Recognition
) -> tuple[float, str] | None:
    """Find the counter whose ticks the stamps are, where they are no decimal part of a second.

    Parameters
    ----------
    imu : ImuSamples
    gnss : GnssFixes
    unit_s : float, s
        What one count of the stamps was taken for.
    recognition : Recognition
        Of both with that unit.

    Returns
    -------
    tuple of float and str, or None
        Ticks per second, Hz, and the evidence; None where no counter explains the motion
        `CLEARLY_TICKS` better, or the unit explains it as it is.
    """
    claimed = unexplained_share(recognition)
    if claimed < EXPLAINED_SHARE:
        return None
    ratio = (imu.time[-1] - imu.time[0]) / max(gnss.time[-1] - gnss.time[0], 1.0) / unit_s
    tries = []
    for hertz in COUNTERS_HZ:
        if 1.0 / LENGTHS_APART < ratio / hertz < LENGTHS_APART:
            start = imu.time[0]
            counted = replace(imu, time=start + (imu.time - start) / (unit_s * hertz))
            tries.append((unexplained_share(recognise(counted, gnss)), hertz))
    misfit, hertz = min(tries, default=(1.0, 0.0))
    if misfit > MOST_OF_TICKS or CLEARLY_TICKS * misfit > claimed:
        return None
    return hertz, (
        f"counts of 1/{hertz:.0f} s explain {1.0 - misfit:.1%} of the motion that GNSS saw, counts"
        f" of {unit_s:g} s {1.0 - claimed:.1%}"
    )


def unexplained_share(recognition: Recognition) -> float:
    """Return the share of the motion that GNSS saw and the IMU does not; 1 where none is sure."""
    if recognition.finding("time offset").confidence <= SURE_OF_EXCHANGE:
        return 1.0
    return 1.0 - float(recognition.curves["lag_score"].max())


def _move_stamps(imu: ImuSamples, rows: slice, by: float) -> ImuSamples:
    """Return the samples with the stamps of some moved."""
    time = imu.time.copy()
    time[rows] += by
    return replace(imu, time=time)


def _misfit(imu: ImuSamples, gnss: GnssFixes, instant: float) -> tuple[float, float]:
    """Share of the motion about `instant` that samples leave unexplained, and their time offset, s.

    The share is 1 where nothing is sure.
    """
    lo, hi = instant - 0.5 * LOOKED_AT_S, instant + 0.5 * LOOKED_AT_S
    if not ((gnss.time >= lo) & (gnss.time < hi)).any():
        return 1.0, 0.0
    recognition = recognise_between(imu, gnss, lo, hi)
    misfit = unexplained_share(recognition)
    return misfit, recognition.time_offset_s if misfit < 1.0 else 0.0
