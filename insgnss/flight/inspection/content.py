"""The keys of the flight file of an inspected recording, each with the evidence for it.

Recognised values are written where their confidence exceeds `SURE`, else as comments with the
reason. Numbers that a file's own header gives a unit for are not given another one unless the data
contradict it.

Its noise model is a shipped one, or one of what was measured.
"""

import numpy as np

from ...base.units import MILLI_G
from ...io.formats import SENSOR_SCALES
from ...io.formats.text.headers import factor_of, kinds_like
from ...navigation.recognise.recognition import Recognition
from ...navigation.recognise.streams import classes_apart
from ...records import GnssFixes, ImuSamples
from ..config.flight_file import ROLLOVER
from .alone import Alone
from .draft import NOISE_FILE, Draft
from .event_clock import SCALE_OPEN
from .evidence import SAME_FACTOR, SURE, UNIT_CHECKS, AxesFound, factor_of_numbers, in_words
from .mounting_drawing import drawn_in_letters
from .result import Recorded
from .rinex.result import draft_raw_gnss
from .sensing import DEG_S, Sensing, fitting_model, noise_model
from .sources import InputSource


def draft_noise(draft: Draft, sensing: Sensing) -> None:
    """Name the shipped noise model that fits, or draft one of the recording.

    Parameters
    ----------
    draft : Draft
        Gets `imu.noise`, and the model where none fits.
    sensing : Sensing
    """
    quiet = (
        f"{sensing.rest_gyro.max() / DEG_S:.2g} deg/s/sqrt(Hz) and"
        f" {sensing.rest_accel.max() / MILLI_G:.2g} mg/sqrt(Hz)"
    )
    moving = (
        f"{sensing.moving_gyro.max() / DEG_S:.2g} and {sensing.moving_accel.max() / MILLI_G:.2g}"
    )
    state = "at rest" if sensing.rest_s > 0.0 else "where it is quietest"
    measured = f"white noise measured: {quiet} {state}"
    if not sensing.is_static:
        measured += f", {moving} in motion, where vibration counts"
    name = fitting_model(sensing)
    if name is not None:
        draft.add("imu", "noise", name, f"the shipped model fits: {measured}")
        return
    draft.add(
        "imu",
        "noise",
        NOISE_FILE,
        f"no shipped noise model fits ({measured}); the sensor is of the class {sensing.grade}",
    )
    draft.noise = noise_model(sensing, draft.tables[""][0].value)
    bias = (
        "the turn-on bias of the gyros is set from the mean rate at rest"
        if sensing.rest_s > 0.0
        else "no stationary period: turn-on biases are a-priori"
    )
    draft.noise_why = (
        f"Drafted by insgnss inspect. {measured[0].upper()}{measured[1:]}; the largest is taken.",
        (
            f"{bias[0].upper()}{bias[1:]}; Gauss-Markov processes, scale factors and "
            f"misalignments are a-priori values of a {sensing.grade} sensor. Static recordings "
            "give a better noise model: insgnss tune."
        ),
    )


KNOWN_S = 0.005  # a latency known to this needs no state
LEVER_SIGMA_M = 1.0  # an antenna on the roof of a car
DRAFT_REMARKS = (
    "Drafted by insgnss inspect from the recording itself; the evidence is above each key.",
    "The data do not determine keys that are commented out; check these by hand.",
)
NEEDS_FIXES = "IMU samples alone give no position; give the file of GNSS fixes as well"
NEEDS_POSITION = (
    "a static recording needs a position to become a flight; set gnss.stationary = [latitude, "
    "longitude, height] in a flight file, or make a noise model of the recording with insgnss tune"
)


def draft_flight(
    recorded: Recorded, sensing: Sensing, axes: AxesFound, alone: Alone
) -> tuple[Draft | None, str]:
    """Draft the flight file.

    Parameters
    ----------
    recorded : Recorded
        The recording.
    sensing : Sensing
        What its samples show of the sensor.
    axes : AxesFound
        Of the IMU.
    alone : Alone
        What was found without a receiver.

    Returns
    -------
    tuple of Draft or None, str
        The draft, or None and what is missing for one.
    """
    gnss, recognition, rinex = recorded.gnss, recorded.recognition, recorded.rinex
    by_role = {source.role: source for source in recorded.sources}
    site = by_role["imu"].site
    raw_gnss = rinex is not None and not rinex.missing and site is None and gnss is None
    rover = rinex.rover if rinex is not None and raw_gnss else None
    rover_events = 0 if rover is None else rover.events
    if rinex is not None and rinex.missing and site is None and gnss is None:
        return None, f"no fixes of a receiver, and the RINEX files lack {rinex.missing}"
    if gnss is None and site is None and not raw_gnss:
        return None, _missing(by_role["imu"], sensing, alone)
    draft = Draft(remarks=DRAFT_REMARKS)
    draft.add("", "name", recorded.name)
    if recorded.week is not None:
        week, origin = recorded.week
        draft.add("", "gps_week", week, origin, week >= ROLLOVER)
    _imu(draft, recorded, sensing, axes, alone.units)
    if raw_gnss:
        assert rinex is not None
        draft_raw_gnss(draft, rinex)
    elif gnss is None:
        assert site is not None
        draft.add(
            "gnss",
            "stationary",
            list(site),
            "latitude deg, longitude deg, height m of the site in the file's header; the sensor"
            " is stationary",
        )
    else:
        _gnss(draft, by_role["gnss"], gnss, recognition)
    if "events" in by_role:
        draft.add("camera", "events", by_role["events"].path, f"{by_role['events'].what}")
        source = by_role["events"]
        for key in ("columns", "units", "time_scale"):
            if key in source.keys:
                reason = source.why[key]
                draft.add("camera", key, source.keys[key], reason, reason != SCALE_OPEN)
        draft.add("camera", "clock", *recorded.event_clock)
    elif rover_events:
        text = f"{rover_events} camera events are in the rover's file; name the images"
        draft.add("camera", "images", "photos", text, False)
    _mounting(draft, "events" in by_role or bool(rover_events))
    if gnss is not None or raw_gnss:
        _filter(draft, gnss, recognition)
    draft.add("output", "directory", "results")
    return draft, ""


def _missing(source: InputSource, sensing: Sensing, alone: Alone) -> str:
    """Name what samples without a position lack to become a flight."""
    open_questions = (
        [f"no clock ({source.keys['rate_hz']:g} Hz assumed)"] if "rate_hz" in source.keys else []
    )
    open_questions += ["no unit of the gyros"] if alone.gyro_counts is not None else []
    also_open = f"; the file has {' and '.join(open_questions)}" if open_questions else ""
    return (NEEDS_POSITION if sensing.is_static else NEEDS_FIXES) + also_open


def _imu(
    draft: Draft, recorded: Recorded, sensing: Sensing, axes: AxesFound, units: dict[str, str]
) -> None:
    source, raw = recorded.sources[0], recorded.imu
    rate = f"{sensing.rate_hz:.4g} Hz, {raw.time.size} samples, {sensing.length_s:.0f} s"
    draft.add("imu", "file", source.path, f"{source.what}: {rate}{left_out(source)}")
    if "accel_file" in source.keys:
        draft.add("imu", "accel_file", source.keys["accel_file"], source.what)
    for key in ("variable", "rate_hz"):
        if key in source.keys:
            draft.add("imu", key, source.keys[key], source.why.get(key, ""), key != "rate_hz")
    if "columns" in source.keys:
        draft.add("imu", "columns", source.keys["columns"], source.why["columns"])
    _units(draft, source, raw, recorded.recognition, units)
    draft.add("imu", "axes", axes.directions, axes.why, axes.sure)
    draft_noise(draft, sensing)


def _units(
    draft: Draft,
    source: InputSource,
    raw: ImuSamples,
    recognition: Recognition | None,
    alone: dict[str, str],
) -> None:
    """Quantity, units and sign of the force."""
    header = _header_units_of_kind(
        source, raw.quantity if recognition is None else recognition.quantity
    )
    units = header | source.keys.get("units", {})
    why = [source.why["units"]] if "units" in source.why else []
    why += [f"the header gives {' and '.join(header.values())}"] if header else []
    if recognition is None:
        if raw.quantity != "mean_rate":
            draft.add("imu", "quantity", raw.quantity, source.why.get("quantity", ""))
        if units | alone:
            why += ["gravity and noise at rest"] if alone else []
            draft.add("imu", "units", units | alone, "; ".join(why))
        return
    for key, name in UNIT_CHECKS.items():
        why.append(in_words(recognition.finding(name)))
        unit = _unit_of_numbers(source, recognition, key)
        if unit is not None:
            units[key] = unit
    finding = recognition.finding("quantity")
    draft.add(
        "imu",
        "quantity",
        recognition.quantity,
        in_words(finding),
        finding.confidence > SURE or recognition.quantity == "mean_rate",
    )
    if units:
        draft.add("imu", "units", units, "; ".join(why))
    sign = recognition.finding("force sign")
    if recognition.accel_sign < 0 and not recognition.exchanges:
        mirrored = (
            "exchanged latitude and longitude, or a wrong sign of one, looks the same; check both"
        )
        draft.add("imu", "accel_sign", -1, f"{in_words(sign)}; {mirrored}", sign.confidence > SURE)


def _header_units_of_kind(source: InputSource, quantity: str) -> dict[str, str]:
    """Units of gyro and accel that the file's header gives, as far as they are of the quantity."""
    kinds = {key: f"{key} increment" if quantity == "increments" else key for key in UNIT_CHECKS}
    return {
        key: unit
        for key, unit in (source.header_units or {}).items()
        if factor_of(unit, (kinds[key],)) is not None
    }


def _unit_of_numbers(source: InputSource, recognition: Recognition, key: str) -> str | None:
    """Unit of a sensor's numbers, where the data show it and the file gives none or another."""
    factor = factor_of_numbers(recognition, key)
    if source.header_units is None or not recognition.finding(UNIT_CHECKS[key]).confidence > SURE:
        return None
    header_unit = source.header_units.get(key)
    kind = f"{key} increment" if recognition.quantity == "increments" else key
    if header_unit is not None:
        if abs(factor - 1.0) < SAME_FACTOR and key in _header_units_of_kind(
            source, recognition.quantity
        ):
            return None
        factor *= factor_of(header_unit, kinds_like(key)) or 1.0
    unit, base = next(
        (
            (name, f)
            for name, f in SENSOR_SCALES[kind].items()
            if abs(factor / f - 1.0) < SAME_FACTOR
        ),
        (None, 1.0),
    )
    return unit if unit is not None else f"{factor / base:.8g} {next(iter(SENSOR_SCALES[kind]))}"


def _gnss(
    draft: Draft, source: InputSource, gnss: GnssFixes, recognition: Recognition | None
) -> None:
    step = float(np.median(np.diff(gnss.time))) if gnss.time.size > 1 else np.nan
    rate = f"{gnss.time.size} fixes, {1.0 / step:.3g} Hz"
    draft.add("gnss", "file", source.path, f"{source.what}: {rate}{left_out(source)}")
    of_file = "variable columns units reference repeat_column sigma_m sigma_velocity_mps"
    for key in of_file.split():
        if key in source.keys:
            draft.add("gnss", key, source.keys[key], source.why.get(key, ""))
    if classes := classes_apart(gnss):
        floors = {quality.name.lower(): sigma for quality, (_, sigma, _) in classes.items()}
        why = "; ".join(finding for finding, _, _ in classes.values())
        draft.add("gnss", "quality_sigma_m", floors, f"{why}: standard deviations that cover this")
    if source.free_height:
        why = (
            "if the heights are above the geoid, write the geoid's height above the ellipsoid here"
        )
        draft.add("gnss", "undulation_m", 0.0, source.why.get("undulation_m", why), sure=False)
    if recognition is None or not np.isfinite(recognition.time_offset_sigma_s):
        why = (
            "the data do not determine the latency"
            if recognition is None
            else in_words(recognition.finding("time offset"))
        )
        draft.add("gnss", "time_offset_s", 0.0, why, sure=False)
        return
    scale = recognition.finding("time scale")
    why = in_words(recognition.finding("time offset")) + (
        f"; time scale {scale.found}: {scale.evidence}" if recognition.time_scale != "same" else ""
    )
    significant = abs(recognition.time_offset_s) > 2.0 * recognition.time_offset_sigma_s
    draft.add(
        "gnss",
        "time_offset_s",
        round(recognition.time_offset_s, 4),
        why if significant else f"{why}; not significantly different from zero",
        significant,
    )


def _mounting(draft: Draft, camera: bool) -> None:
    camera_axes, unknown = [[-1, 0, 0], [0, -1, 0], [0, 0, 1]], [0.0, 0.0, 0.0]
    draft.add(
        "mounting",
        "antenna_m",
        unknown,
        "the files hold no lever arms; measure the vector from the camera in camera axes, m",
        drawing=drawn_in_letters(camera_axes, unknown, unknown),
    )
    if camera:
        draft.add("mounting", "imu_m", unknown)
        draft.add(
            "mounting",
            "camera_from_body",
            camera_axes,
            "axes of the camera as in the published data sets; check these for this drone",
            False,
        )


def _filter(draft: Draft, gnss: GnssFixes | None, recognition: Recognition | None) -> None:
    sigma = np.inf if recognition is None else recognition.time_offset_sigma_s
    if not sigma < KNOWN_S:
        latency = (
            f"the time offset is known to {1e3 * sigma:.0f} ms only"
            if np.isfinite(sigma)
            else "the time offset is not known"
        )
        draft.add("filter", "time_offset", True, f"{latency}; the filter estimates what remains")
    if draft.noise is not None and draft.noise.gyro[0].scale_factor:
        draft.add(
            "filter",
            "scale_factor",
            True,
            "the sensor is not calibrated, so scale errors of 1 % (3.6 deg in 360 deg) are "
            "estimated",
        )
        draft.add(
            "filter",
            "misalignment",
            True,
            "the sensor axes may not be orthogonal, so misalignments are estimated; a rotation of "
            "the gyros in their case counts as bore-sight",
        )
    draft.add(
        "filter",
        "lever_arm",
        True,
        "the lever arm is not known, so the filter estimates it, and its uncertainty makes the "
        "positions of all images less accurate. Measure the lever arm and delete both keys",
    )
    draft.add("filter", "lever_arm_sigma_m", LEVER_SIGMA_M)
    coded = gnss is not None and gnss.quality is not None
    which = "a wrong ambiguity fix keeps its code" if coded else "fixes of unknown quality"
    draft.add("filter", "robust", True, f"{which}: outliers get less weight (Huber)")


def left_out(source: InputSource) -> str:
    """Name the columns of a source's table that nothing takes; empty where all are taken."""
    columns = source.columns_left_out
    return f"; columns left out: {', '.join(columns)}" if columns else ""
