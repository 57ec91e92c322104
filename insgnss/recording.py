"""What the files of a flight hold, on one clock, and what the checks say of it."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .errors import DataError, InputError, InsgnssError, UsageError
from .flight import QUALITIES, Flight, ImuInput
from .records import Array, CameraEvents, Check, GnssFixes, ImuSamples
from .units import STANDARD_GRAVITY

if TYPE_CHECKING:
    from .gnss.ppk import PpkResult
    from .prepare.still import Stretches
    from .recognise.recognition import Recognition
    from .stochastic.model import NoiseModel

Progress = Callable[[str], None]

LONG_LEVER_M, LARGE_BORESIGHT_DEG = 3.0, 10.0
RECOGNISED_S, LATEST_S, FASTEST_MS = 300.0, 30.0, 50.0
UNIT_WORDS = ("rad/s", "deg/s", "deg/h", "m/s^2", "g", "mg", "rad", "deg", "m/s")
STANDING_S, STANDING_SIGMA_M, STANDING_SHARE = 1.0, (0.1, 0.1, 0.1), 0.8
TURN_ON = {"gyro": np.radians(100.0) / 3600.0, "accel": 2e-3 * STANDARD_GRAVITY}  # of a calibrated MEMS IMU
TURN_ON_ADVICE = "set turn_on_bias in the noise model: 100 deg/h and 2 mg suit a calibrated MEMS IMU, or as its recordings at rest tell"


def quiet(_: str) -> None:
    """No progress."""


@dataclass(frozen=True)
class Recording:
    """What the files of a flight hold, on one clock (seconds of `gps_week`), and what the checks say of it.

    C_b_imu (3, 3): the samples' axes to body.   rests : when the sensor stood still.
    noise : model of the samples, those of several IMUs combined.   turn_on : the bias that the rests show, in words, or "".
    recognition : what the data say of themselves, None where a check had to stop before.   ppk : of raw observations.
    """

    imu: ImuSamples
    gnss: GnssFixes
    events: CameraEvents | None
    gps_week: int
    checks: tuple[Check, ...]
    C_b_imu: Array
    rests: "Stretches"
    noise: "NoiseModel"
    turn_on: str = ""
    recognition: "Recognition | None" = None
    ppk: "PpkResult | None" = None


@dataclass(frozen=True)
class InspectResult:
    """Checks of a recording."""

    name: str
    checks: tuple[Check, ...]

    @property
    def contradictions(self) -> list[str]:
        """One sentence for each check that the data contradict."""
        return [sentence(c) for c in self.checks if c.verdict == "contradiction"]

    def summary(self) -> str:
        """A table that a person reads."""
        width = max(len(c.name) for c in self.checks)
        mark = {"ok": "ok  ", "note": "note", "contradiction": "BAD "}
        lines = [self.name]
        for c in self.checks:
            lines.append(f"{mark[c.verdict]}  {c.name:<{width}}  {c.found}")
            if c.verdict != "ok":
                lines.append(f"      {'':<{width}}  expected: {c.expected}" + (f"; {c.advice}" if c.advice else ""))
        return "\n".join(lines)

    def as_dict(self) -> dict[str, Any]:
        """JSON-able."""
        return {"name": self.name, "checks": [asdict(c) for c in self.checks]}


def sentence(check: Check) -> str:
    """A check in one sentence."""
    return f"{check.name}: {check.found}; expected {check.expected}; {check.advice}"


def read_recording(flight: Flight) -> Recording:
    """Read the files of a flight, bring them to one clock and check them."""
    from .prepare.clock import common_clock, cut_events
    from .prepare.quality import with_floors
    from .prepare.still import still_stretches
    from .recognise.plausibility import check_recording
    from .stochastic.model import load_noise_model

    try:
        imu, gnss, events, ppk = _read_files(flight)
    except UsageError as error:  # an option of the flight file that its file's format does not have
        raise InputError(f"{flight.path}: {error}") from None
    if flight.gnss.time_offset_s:
        gnss = replace(gnss, time=gnss.time + flight.gnss.time_offset_s)
    if events is not None and flight.camera is not None and flight.camera.time_offset_s:
        events = replace(events, time=events.time + flight.camera.time_offset_s)
    imu, gnss, events, week = common_clock(imu, gnss, events, flight.gps_week)
    gnss = with_floors(gnss, {QUALITIES[name]: sigma for name, sigma in flight.gnss.quality_sigma_m.items()})
    origin = None if flight.tangent_plane is None else np.asarray(flight.tangent_plane.origin)
    C_b_imu, noise = flight.imu.C_b_imu, load_noise_model(flight.imu.noise)
    more: list[Check] = []
    if flight.imu.more:
        imu, noise, more = _combined(flight, imu, noise)
        C_b_imu = np.eye(3)
    checks = [*check_recording(imu, C_b_imu, gnss, events, origin), *more, *(ppk.checks if ppk else ())]
    checks.append(_check_mounting(flight))
    if without_turn_on(noise):
        checks.append(check_turn_on(noise))
    checks += [note for record in (imu, gnss, events) if record is not None for note in record.notes]
    if events is not None:
        every = len(events.images)
        events = cut_events(events, flight.start_tow, flight.end_tow)
        if len(events.images) < every:
            found = f"{every - len(events.images)} of {every} images left out"
            checks.append(Check("start_tow, end_tow", found, "all images within", "note"))
    recognition = None
    if flight.gnss.stationary is None and not any(check.verdict == "contradiction" for check in checks):
        recognition, disagreements = _recognised(flight, imu, C_b_imu, gnss)
        checks += disagreements
    rests = still_stretches(imu, gnss)
    rests = rests.where(np.searchsorted(gnss.time, rests.time[:, 1]) > np.searchsorted(gnss.time, rests.time[:, 0]))
    if flight.gnss.stationary is not None:
        checks = [check for check in checks if not check.name.startswith("GNSS ")] + [_check_standing(imu, rests.time)]
    told = _turn_on(rests, C_b_imu, noise, gnss) if len(rests) else ""
    if flight.filter.zero_velocity == "off":
        rests = rests.where(np.zeros(len(rests), dtype=np.bool_))
    return Recording(imu, gnss, events, week, tuple(checks), C_b_imu, rests, noise, told, recognition, ppk)


def _read_files(flight: Flight) -> "tuple[ImuSamples, GnssFixes, CameraEvents | None, PpkResult | None]":
    """Samples, fixes, exposures, and the PPK solution where it gave the fixes."""
    from .exposures.naming import named
    from .formats import read_events, read_gnss

    g, camera = flight.gnss, flight.camera
    imu = _read_imu(flight.imu, flight.gps_week)
    events = None
    if camera is not None and camera.events is not None:
        given, week = camera.events, flight.gps_week
        events = read_events(given, columns=camera.columns, gps_week=week) if isinstance(given, Path) else given
        events = named(events, camera.match)
    if g.raw is not None:
        from .gnss.flown import solve_flown

        of_rover = None if camera is None else (camera.rover_events, camera.match)
        ppk = solve_flown(g.raw, g.covariance, of_rover if events is None else False)
        return imu, ppk.fixes, ppk.events if events is None else events, ppk
    if g.stationary is not None:
        gnss = standing_fixes(g.stationary, g.sigma_m or STANDING_SIGMA_M, imu)
    elif isinstance(g.file, GnssFixes):
        gnss = g.file
    else:
        assert g.file is not None
        gnss = read_gnss(
            g.file,
            columns=g.columns,
            sigma_m=g.sigma_m,
            sigma_velocity=g.sigma_velocity_mps,
            units=g.units or None,
            undulation_m=g.undulation_m,
            variable=g.variable,
            new_when=g.new_when,
            gps_week=flight.gps_week,
        )
        if g.calibrated:
            from .gnss.ready import with_calibrated

            gnss = with_calibrated(gnss, g.file, g.covariance)
    return imu, gnss, events, None


def _read_imu(i: ImuInput, gps_week: int | None) -> ImuSamples:
    """Samples of one IMU: calibrated, force with the sign of specific force."""
    from .formats import read_imu
    from .prepare.calibration import load_calibration
    from .prepare.hanging import without_hangs
    from .recognise.plausibility import STILL_S

    if isinstance(i.file, Path):
        how = {"columns": i.columns, "units": i.units, "variable": i.variable, "rate_hz": i.rate_hz}
        imu = read_imu(i.file, quantity=i.quantity, gps_week=gps_week, **how)
    else:
        imu = i.file
    imu = without_hangs(imu, STILL_S)
    if i.accel_sign < 0:
        imu = replace(imu, accel=-imu.accel)
    if i.time_offset_s:
        imu = replace(imu, time=imu.time + i.time_offset_s)
    return imu if i.calibration is None else load_calibration(i.calibration).apply(imu)


def _combined(flight: Flight, first: ImuSamples, model: "NoiseModel") -> "tuple[ImuSamples, NoiseModel, list[Check]]":
    """All IMUs of the flight as one in body axes at the first one's place, its noise, and what they say of each other."""
    from .prepare.clock import in_week
    from .prepare.combine import combine
    from .stochastic.model import load_noise_model, weighted_model

    inputs = flight.imu.more
    imus = [first, *(in_week(_read_imu(i, first.gps_week), first.gps_week or 0) for i in inputs)]
    for k, imu in enumerate(imus[1:], start=2):
        if np.array_equal(imu.gyro, first.gyro):
            raise InputError(f"{flight.path}: imu.more: IMU {k} ({imu.source}) is the first IMU again; give its own file or columns")
    models = [model, *(load_noise_model(i.noise) for i in inputs)]
    white = [(m.gyro[0].white_noise, m.accel[0].white_noise) for m in models]
    levers = [(0.0, 0.0, 0.0), *(i.lever_m for i in inputs)]
    all_in_one = combine(imus, [flight.imu.C_b_imu, *(i.C_b_imu for i in inputs)], levers, white)
    return all_in_one.samples, weighted_model(models, [tuple(w) for w in all_in_one.weight]), list(all_in_one.checks)


def _turn_on(rests: "Stretches", C_b_imu: Array, noise: "NoiseModel", gnss: GnssFixes) -> str:
    """What the rests say of the bias, for the report; the filter finds it itself from the same rests."""
    from .calibrate.turn_on import turn_on_bias

    gyro, accel = ([axis.turn_on_bias or 1e-9 for axis in triad] for triad in (noise.gyro, noise.accel))
    try:
        return turn_on_bias(rests, C_b_imu, float(gnss.lat[0]), float(gnss.height[0]), gyro, accel).summary()
    except DataError as error:
        return f"no turn-on bias from the rests: {error}"


def _recognised(flight: Flight, imu: ImuSamples, C_b_imu: Array, gnss: GnssFixes) -> "tuple[Recognition, list[Check]]":
    """What the liveliest minutes of the recording say of units, axes, sign and clock, against the flight file."""
    from .prepare.clock import cut_fixes, cut_samples
    from .recognise.recognition import compare, recognise

    lo, hi = _liveliest(gnss)
    i = flight.imu
    found = recognise(cut_samples(imu, lo - LATEST_S, hi + LATEST_S), cut_fixes(gnss, lo, hi))
    claim = {f"{key}_unit": unit for key, unit in imu.units.items() if unit in UNIT_WORDS}
    offset = flight.gnss.time_offset_s - i.time_offset_s
    return found, compare(found, C_b_imu, quantity=imu.quantity, accel_sign=int(i.accel_sign), time_offset_s=offset, **claim)


def _liveliest(gnss: GnssFixes) -> tuple[float, float]:
    """Begin and end of the `RECOGNISED_S` with the longest path."""
    from .prepare.fix_path import north_east

    step = np.minimum(np.linalg.norm(np.diff(north_east(gnss), axis=0), axis=1), FASTEST_MS * np.diff(gnss.time))
    path = np.concatenate([[0.0], np.cumsum(step)])
    end = np.searchsorted(gnss.time, gnss.time + RECOGNISED_S, side="right") - 1
    first = int(np.argmax(path[end] - path))
    return float(gnss.time[first]), float(gnss.time[end[first]])


def without_turn_on(noise: "NoiseModel") -> tuple[str, ...]:
    """Sensors with noise of which an axis has no turn_on_bias."""
    return tuple(s for s in TURN_ON if any(a.white_noise > 0.0 and a.turn_on_bias == 0.0 for a in getattr(noise, s)))


def with_turn_on(noise: "NoiseModel") -> "NoiseModel":
    """The model with `TURN_ON` where an axis has no turn_on_bias."""
    gx, gy, gz = (replace(axis, turn_on_bias=axis.turn_on_bias or TURN_ON["gyro"]) for axis in noise.gyro)
    ax, ay, az = (replace(axis, turn_on_bias=axis.turn_on_bias or TURN_ON["accel"]) for axis in noise.accel)
    return replace(noise, gyro=(gx, gy, gz), accel=(ax, ay, az))


def check_turn_on(noise: "NoiseModel") -> Check:
    """What a noise model `without_turn_on` does, as one that variances tell is."""
    missing = " and ".join(without_turn_on(noise))
    found = f"noise model {noise.name} without turn_on_bias of {missing}: constant biases are taken for zero"
    return Check("turn-on bias", found, "turn_on_bias of gyro and accel", "note", TURN_ON_ADVICE)


def _check_standing(imu: ImuSamples, rests: Array) -> Check:
    """Whether the IMU that `gnss.stationary` says to stand does so."""
    share = float(np.sum(rests[:, 1] - rests[:, 0]) / (imu.time[-1] - imu.time[0]))
    bad = share < STANDING_SHARE
    advice = "a moving sensor needs fixes: give gnss.file" if bad else ""
    found = f"at rest for {100 * share:.0f} % of the time"
    return Check("standing", found, f"for {100 * STANDING_SHARE:.0f} % at least", "contradiction" if bad else "ok", advice)


def standing_fixes(place: tuple[float, ...], sigma_m: tuple[float, ...], imu: ImuSamples) -> GnssFixes:
    """A fix a second at a known place (latitude, longitude deg, height m), for an IMU that stands there throughout."""
    time = np.arange(imu.time[0], imu.time[-1], STANDING_S)
    lat, lon, height = (np.full(time.size, x) for x in (*np.radians(place[:2]), place[2]))
    cov = np.broadcast_to(np.diag(np.square(sigma_m)), (time.size, 3, 3))
    return GnssFixes(time, lat, lon, height, cov, gps_week=imu.gps_week, source="gnss.stationary")


def _check_mounting(flight: Flight) -> Check:
    """Size of what no data check: lever arms and bore-sight."""
    m = flight.mounting
    lever = max(float(np.linalg.norm(v)) for v in (m.antenna_lever_b, m.camera_lever_b))
    angle = float(np.degrees(np.arccos(np.clip(0.5 * (np.trace(m.boresight) - 1.0), -1.0, 1.0))))
    found = f"longest lever arm {lever:.3f} m, bore-sight {angle:.2f} deg"
    if flight.camera is not None and lever == 0.0 and angle == 0.0:
        return Check(
            "mounting",
            "no lever arm and no bore-sight given: the images get the place and the attitude of the IMU",
            "[mounting] of the camera",
            "note",
            "measure the lever arms from the camera to antenna and IMU, calibrate the bore-sight, and give them in [mounting]",
        )
    odd = lever > LONG_LEVER_M or angle > LARGE_BORESIGHT_DEG
    return Check(
        "mounting",
        found,
        f"lever arms below {LONG_LEVER_M:g} m, bore-sight below {LARGE_BORESIGHT_DEG:g} deg",
        "note" if odd else "ok",
        "the data cannot tell: check units, signs and mounting by hand" if odd else "",
    )


def inspect(flight: Flight, progress: Progress = quiet, recording: Recording | None = None) -> InspectResult:
    """Check a flight without processing it; what needs the attitude (heading against course) is left to `process`.

    recording : what `read_recording` made of it, where that is known already.
    """
    from .prepare.clock import common_span, refuse_outside

    progress("reading")
    recording = recording or read_recording(flight)
    checks = list(recording.checks)
    try:
        lo, hi = common_span(recording.imu, recording.gnss, flight.start_tow, flight.end_tow)
        if recording.events is not None:
            refuse_outside(recording.events, lo, hi)
    except InsgnssError as error:
        checks.append(Check("span", str(error), "IMU, GNSS and images overlap", "contradiction"))
    checks.append(Check("heading against course", "not checked here", "needs the attitude: `insgnss process` checks it"))
    return InspectResult(flight.name, tuple(checks))
