"""Static recordings to wavelet variances.

They are read, identified by their digest, checked, and condensed to what the fit needs. A recording
is let go once its wavelet variances and block means are taken, so that memory holds one at a time.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from shlex import quote

import numpy as np

from ...base.errors import DataError, InputError, UsageError
from ...base.inputs import first_bytes, read_bytes, sha256
from ...base.wording import spoken_as
from ...io.formats.imu.variances import read_variances
from ...io.formats.logs.rosbag import bag_file
from ...navigation.noise_model.model import RecordingSource
from ...navigation.prepare.static_recording import Disturbance, StaticSpan, static_span
from ...records import Array, Finding, Question, WaveletVariance
from ..moments.wavelet import wavelet_variances
from .options import TuneOptions
from .reading import FILE_HEAD_BYTES, OPTION_NAMES, read_samples
from .some_channels import chosen_channels, no_unit

Progress = Callable[[str], None]

SENSORS, SENSOR_AXES = ("gyro", "accel"), ("x", "y", "z")
TREND_BLOCKS = 128  # equal parts (chosen): the shortest warm-up, 1/100 of a recording, shows
POOLING = "pooling"  # name of the check that recordings are alike


@dataclass(frozen=True, eq=False)
class StaticRecording:
    """What is kept of one recording.

    Parameters
    ----------
    source : RecordingSource
        File, digest, samples and rate.
    curves : mapping of (str, int) to WaveletVariance
        Wavelet variance (X^2) by sensor and axis, 0 to 2.
    blocks : mapping of str to ndarray (TREND_BLOCKS, 3), or None
        Means of equal parts in time by sensor; None where only variances are known.
    begin_s, length_s : float
        Begin and length of the part that was used, s.
    checks : tuple of Finding
        Checks of the recording.
    disturbances : tuple of Disturbance
        Disturbances in it.
    """

    source: RecordingSource
    curves: Mapping[tuple[str, int], WaveletVariance]
    blocks: Mapping[str, Array] | None
    begin_s: float
    length_s: float
    checks: tuple[Finding, ...] = ()
    disturbances: tuple[Disturbance, ...] = ()

    @property
    def name(self) -> str:
        """The name of its file."""
        return self.source.file


def read_static(path: Path, options: TuneOptions, progress: Progress) -> StaticRecording:
    """Read, check and condense one recording.

    Parameters
    ----------
    path : Path
        The file.
    options : TuneOptions
        How to read it; `accept` overrules a check.
    progress : callable
        Takes a line on each step.

    Returns
    -------
    StaticRecording
        What the fit needs of it.

    Raises
    ------
    InputError
        For a wrong file.
    UsageError
        Where units or columns are missing.
    DataError
        For a recording that does not show the noise of a stationary sensor.
    """
    path = bag_file(path)
    progress(f"reading {path.name}")
    with spoken_as(OPTION_NAMES):
        if holds_variances(path):
            return _published_variances(path, options)
    imu, channels = read_samples(path, options)
    progress(f"checking {path.name}")
    span = static_span(imu, options.skip_s, options.keep_s, options.bridge_s, channels)
    _refuse_unfit(path, span, options.accept)
    progress(f"wavelet variances of {path.name}")
    triads = {"gyro": span.gyro, "accel": span.accel}
    requested = chosen_channels(options.only)
    tuned = tuple(has and chosen for has, chosen in zip(channels, requested, strict=True))
    if not any(tuned):
        raise UsageError(
            f"{path}: --only {options.only!r} names none of its channels; name some or leave it out"
        )
    curves, method_notes = _variances(triads, span, options.robust, tuned)
    blocks = {sensor: _block_means(values) for sensor, values in triads.items()}
    source = RecordingSource(path.name, sha256(path), len(span.gyro), round(span.rate_hz, 6))
    return StaticRecording(
        source,
        curves,
        blocks,
        span.begin_s,
        span.length_s,
        (*span.checks, *method_notes),
        span.disturbances,
    )


def _variances(
    triads: Mapping[str, Array], span: StaticSpan, robust: bool | None, tuned: tuple[bool, ...]
) -> tuple[dict[tuple[str, int], WaveletVariance], list[Finding]]:
    """Return the curves of the channels `tuned` (6,), and findings on robust variances.

    robust : None: where the recording holds disturbances, and its rounding allows it.
    """

    def curves_of(robustly: bool) -> dict[tuple[str, int], WaveletVariance]:
        out: dict[tuple[str, int], WaveletVariance] = {}
        for first_channel, (sensor, values) in zip((0, 3), triads.items(), strict=True):
            axes = [k for k in range(3) if tuned[first_channel + k]]
            if axes:
                curves = wavelet_variances(values[:, axes], span.rate_hz, robust=robustly)
                out |= {(sensor, k): curve for k, curve in zip(axes, curves, strict=True)}
        return out

    knocks = len(span.disturbances)
    if robust is not None or not knocks:
        return curves_of(bool(robust)), []
    ask = Question("wavelet variances", "nothing but noise")
    finding = f"{knocks} disturbance{'s' if knocks > 1 else ''}"
    try:
        curves = curves_of(True)
    except DataError as error:
        advice = f"they distort the variances, since robust variances cannot be computed: {error}"
        return curves_of(False), [ask.note(finding, advice)]
    advice = (
        "robust variances are used, which a few disturbances do not distort; --no-robust uses"
        " plain ones"
    )
    return curves, [ask.note(finding, advice)]


def holds_variances(path: Path) -> bool:
    """Tell whether a file holds variances, JSON or a table over scales, instead of samples."""
    content = first_bytes(path, FILE_HEAD_BYTES)
    first_byte = content.lstrip()[:1]
    return first_byte in (b"{", b"[") or (
        first_byte != b"\x93"
        and re.search(rb"(?<![a-z])(scale_s|tau_s|averaging_time)", content) is not None
    )


def _published_variances(path: Path, options: TuneOptions) -> StaticRecording:
    """Return the curves of a file of published variances."""
    content = read_bytes(path)[:FILE_HEAD_BYTES]
    if re.match(rb'\s*\{\s*"recordings":', content):
        raise InputError(
            f"{path}: is the table that insgnss tune wrote beside a noise model; give the"
            " recordings themselves"
        )
    if options.rate_hz is not None and (
        content.lstrip()[:1] in (b"{", b"[") or re.search(rb"(?m)^\W*rate_hz\s*[=:]", content)
    ):
        raise UsageError(f"{path}: the file of variances states its rate; leave --rate out")
    unit_options = {"gyro": options.gyro_unit, "accel": options.accel_unit}
    units = {sensor: unit for sensor, unit in unit_options.items() if unit}
    variances = read_variances(
        path, member=options.variable, units=units or None, rate_hz=options.rate_hz
    )
    unit_line = re.search(rb"(?m)^\W*((gyro|accel)_)?unit\s*[=:]", content)
    curves = {}
    for name, curve in variances.curves.items():
        sensor, _, letter = name.partition("_")
        if sensor not in units and not unit_line:
            example = "rad/s" if sensor == "gyro" else "m/s^2"
            raise no_unit(path, sensor, f"that the {sensor} variances are of", example)
        curves[sensor, SENSOR_AXES.index(letter)] = curve
    longest = max(curves.values(), key=lambda curve: curve.samples / curve.rate_hz)
    source = RecordingSource(path.name, sha256(path), longest.samples, longest.rate_hz)
    description = f"{len(curves)} axes of {variances.sensor or 'a sensor'}"
    checks = (
        Question("variances", "samples").note(
            description, "rest, gaps and disturbances of the recording behind them are not checked"
        ),
    )
    return StaticRecording(source, curves, None, 0.0, longest.samples / longest.rate_hz, checks)


def _refuse_unfit(path: Path, span: StaticSpan, accept: tuple[str, ...]) -> None:
    """Raise DataError with the first check by which the recording is unfit."""
    names = [check.name for check in span.checks]
    for check in span.checks:
        if check.verdict == "contradiction" and check.name not in accept:
            advice = f"{check.advice}; --accept {quote(check.name)} takes it all the same"
            raise DataError(f"{path}: {replace(check, remedy=advice).named_sentence}")
    unknown = [name for name in accept if name not in (*names, "warm-up", POOLING)]
    if unknown:
        raise UsageError(
            f"--accept {unknown[0]!r}: no such check; there are {', '.join((*names, POOLING))}"
        )


def _block_means(values: Array) -> Array:
    """Return the means (TREND_BLOCKS, 3) of equal parts."""
    size = len(values) // TREND_BLOCKS
    return np.asarray(values[: size * TREND_BLOCKS].reshape(TREND_BLOCKS, size, 3).mean(axis=1))
