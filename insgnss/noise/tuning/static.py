"""From static recordings to a noise model: the order of the steps.

read, check, wavelet variances   each recording (`recordings`)
choose, fit, infer               each sensor, axis by axis or the three jointly, over all recordings
                                 (`fitting`)
trends at the start              against the fitted noise (`trend`)
noise model                      its turn-on bias from the means, what cannot be known
                                 written as what it acts like
files                            noise model, table as JSON, page with a chart a sensor (`written`)

The means of static recordings show the constant part of the errors in part. A gyroscope at rest
reads its bias and the Earth's rotation, 15 deg/h in all: the means are the bias unless they are as
small as that. An accelerometer reads its bias and gravity: only the part along the vertical shows,
as the excess of |mean| over 9.80665 m/s^2, and that only beyond +-0.015 m/s^2, by which gravity
varies over the Earth. The spread of the means over recordings is what changes from turn-on to
turn-on; that of the accelerometers holds what the mounting tilted in between.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...base.errors import DataError, UsageError
from ...base.units import DEG_PER_H, MILLI_G, STANDARD_GRAVITY
from ...geodesy.earth import EARTH_RATE
from ...records import Array
from ..processes.composition import Composition
from .fitting import compositions, tune_axes
from .options import TuneOptions, chosen_levels
from .products.written import TUNED_MODEL, noise_model, write
from .recordings import POOLING, SENSOR_AXES, SENSORS, StaticRecording, read_static
from .result import Tuned, TuneResult
from .targets import planned
from .trend import warm_up

GRAVITY_SPREAD = 0.015  # m/s^2, by which gravity varies over the Earth: no bias below it shows
SEES_EARTH = 0.1  # of the Earth's rate, within which |mean rate| is it (chosen): 1.5 deg/h of bias


def turn_on_sigmas(
    recordings: Sequence[StaticRecording],
) -> tuple[dict[str, float], tuple[str, ...]]:
    """Return the standard deviation of the turn-on bias from the means of recordings.

    Parameters
    ----------
    recordings : sequence of StaticRecording
        The recordings.

    Returns
    -------
    values : dict of str to float
        Standard deviation by sensor, rad/s and m/s^2; empty where only variances are known.
    notes : tuple of str
        A sentence on each.
    """
    blocks = [r.blocks for r in recordings if r.blocks is not None]
    if blocks and len(recordings[0].curves) < 6:
        return {}, ("some channels alone do not determine the turn-on bias: set it by hand",)
    if not blocks:
        return {}, (
            (
                "variances do not determine the turn-on bias: the noise model has none; set"
                " turn_on_bias by hand before processing"
            ),
        )
    gyro, accel = (
        np.array([b[sensor].mean(axis=0) for b in blocks]) for sensor in ("gyro", "accel")
    )
    rates = np.linalg.norm(gyro, axis=1)
    if (np.abs(rates / EARTH_RATE - 1.0) < SEES_EARTH).all():
        bias = float(np.sqrt(np.mean((rates - EARTH_RATE) ** 2)))
        how = f"difference of |mean rate| from the Earth's {EARTH_RATE / DEG_PER_H:.2f} deg/h"
    else:
        bias = float(np.sqrt(np.mean(gyro**2)))
        how = f"rms of the means, the Earth's rotation included{_spread(gyro, DEG_PER_H, 'deg/h')}"
    excess = float(np.sqrt(np.mean((np.linalg.norm(accel, axis=1) - STANDARD_GRAVITY) ** 2)))
    force = max(excess, GRAVITY_SPREAD)
    basis = f"along the vertical, the only direction that rest shows{_spread(accel, MILLI_G, 'mg')}"
    notes = (
        f"gyro turn_on_bias {bias / DEG_PER_H:.3g} deg/h: {how}",
        f"accel turn_on_bias {force / MILLI_G:.3g} mg: {basis}",
    )
    return {"gyro": bias, "accel": force}, notes


def _spread(means: Array, unit: float, name: str) -> str:
    """Return what changed from recording to recording, in words."""
    if len(means) < 2:
        return ""
    sd = means.std(axis=0, ddof=1) / unit
    tilt = (
        ", tilts included"
        if name == "mg"
        else "; if a calibration takes the common part away, this is what remains"
    )
    return (
        f"; over {len(means)} recordings the means spread by {sd[0]:.3g} {sd[1]:.3g} {sd[2]:.3g}"
        f" {name} (x y z){tilt}"
    )


Progress = Callable[[str], None]

# of the noise of recordings that cannot be of one IMU, over so many scales
OTHER_IMU_RATIO, FINEST_SCALES = 3.0, 3


def tune_static(
    paths: Sequence[Path],
    options: TuneOptions,
    out: Path | None = None,
    force: bool = False,
    progress: Progress = lambda step: None,
) -> TuneResult:
    """Tune a noise model from static recordings of one IMU and write its files.

    Parameters
    ----------
    paths : sequence of Path
        Static recordings, or files of published variances.
    options : TuneOptions
        How to read and how to fit.
    out : Path, optional
        The noise model; its table and figures stand beside it.
    force : bool
        Overwrite files.
    progress : callable
        Takes a line on each step.

    Returns
    -------
    TuneResult
        The fits, the noise model and the files written.

    Raises
    ------
    UsageError, InputError, DataError
        As `recordings.read_static` and `fitting` do, and UsageError for files of other recordings.
    """
    family = compositions(options)
    target = planned(out or TUNED_MODEL, force, paths)
    if len(set(paths)) < len(paths):
        raise UsageError(
            f"{next(p for p in paths if list(paths).count(p) > 1)}: given twice; one recording"
            " counts once"
        )
    recordings = tuple(read_static(path, options, progress) for path in paths)
    _same(recordings)
    _alike(recordings, options)
    tuned = _fit_all(recordings, family, options, progress)
    values, turn_on = turn_on_sigmas(recordings)
    model = noise_model(target.stem, recordings, tuned, values)
    result = TuneResult(recordings, tuned, model, turn_on, options)
    progress("writing")
    return write(result, target, paths)


def _same(recordings: Sequence[StaticRecording]) -> None:
    """Refuse a recording twice under two names, and recordings of different axes."""
    name_by_digest: dict[str, str] = {}
    for r in recordings:
        if r.source.sha256 in name_by_digest:
            raise UsageError(
                f"{r.name}: the same bytes as {name_by_digest[r.source.sha256]}; a copy is no"
                " second recording"
            )
        name_by_digest[r.source.sha256] = r.name
        if set(r.curves) != set(recordings[0].curves):
            raise DataError(
                f"{r.name}: has other channels than {recordings[0].name}; tune each by itself"
            )


def _alike(recordings: Sequence[StaticRecording], options: TuneOptions) -> None:
    """DataError where the noise of a recording at its finest scales is `OTHER_IMU_RATIO` times that
    of the others, or a part of it as small.

    Compared is the root of wavelet variance times scale, which is the density where noise is white,
    whatever the rate.
    """
    if len(recordings) < 2 or POOLING in options.accept:
        return
    for sensor, k in recordings[0].curves:
        curves = [r.curves[sensor, k] for r in recordings]
        levels = chosen_levels(options.levels, max(int(curve.level[-1]) for curve in curves))
        fine = [np.isin(c.level, levels or c.level).nonzero()[0][:FINEST_SCALES] for c in curves]
        if not all(index.size for index in fine):
            continue
        size = np.array(
            [
                np.log(c.variance[index] * c.scale_s[index]).mean() / 2.0
                for c, index in zip(curves, fine, strict=True)
            ]
        )
        log_ratio = size - [np.median(np.delete(size, i)) for i in range(size.size)]
        i = int(np.argmax(log_ratio)) if size.size == 2 else int(np.argmax(np.abs(log_ratio)))
        if abs(log_ratio[i]) > np.log(OTHER_IMU_RATIO):
            factor = float(np.exp(log_ratio[i]))
            compared_with = "the others" if size.size > 2 else recordings[1 - i].name
            scales = curves[i].scale_s[fine[i]]
            raise DataError(
                f"{recordings[i].name}: {sensor} {SENSOR_AXES[k]} has {factor:.3g} times the "
                "noise of"
                f" {compared_with} at {scales[0]:.3g} to {scales[-1]:.3g} s; no one model serves"
                f" them: another IMU or unit? tune them one by one; --accept {POOLING} takes it all"
                " the same"
            )


def _fit_all(
    recordings: tuple[StaticRecording, ...],
    family: Mapping[str, tuple[Composition, ...]],
    options: TuneOptions,
    progress: Progress,
) -> tuple[Tuned, ...]:
    """All fits, with the trends that they do not explain."""
    rng = np.random.default_rng(options.seed)
    out = []
    for sensor in SENSORS:
        present_axes = [k for k in range(3) if (sensor, k) in recordings[0].curves]
        groups = [tuple(present_axes)] if options.axes == "joint" else [(k,) for k in present_axes]
        for axes in groups:
            if axes:
                out.append(
                    _with_trends(
                        tune_axes(sensor, axes, recordings, family[sensor], options, progress),
                        recordings,
                        rng,
                    )
                )
    return tuple(out)


def _with_trends(
    t: Tuned, recordings: Sequence[StaticRecording], rng: np.random.Generator
) -> Tuned:
    trends = tuple(
        (r.name, k, warm_up(r.blocks[t.sensor][:, k], r.length_s, t.kept.axis, rng))
        for r in recordings
        if r.blocks is not None
        for k in t.axes
    )
    return replace(t, trends=trends)
