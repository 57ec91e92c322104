"""From static recordings to a noise model: the order of the steps.

read, check, wavelet variances   each recording (`recordings`)
choose, fit, infer               each sensor, axis by axis or the three jointly, over all recordings
                                 (`fitting`)
trends at the start              against the fitted noise (`trend`)
noise model                      its turn-on bias from the means (`turn_on`), what cannot be known
                                 written as what it acts like
files                            noise model, table as JSON, page with a chart a sensor (`written`)
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...base.errors import DataError, UsageError
from ..processes.composition import Composition
from .fitting import compositions, tune_axes
from .options import TuneOptions, chosen_levels
from .products.written import noise_model, planned, write
from .recordings import POOLING, SENSOR_AXES, SENSORS, StaticRecording, read_static
from .result import Tuned, TuneResult
from .trend import warm_up
from .turn_on import turn_on_sigmas

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
    target = planned(out, force, paths)
    if len(set(paths)) < len(paths):
        raise UsageError(
            f"{next(p for p in paths if list(paths).count(p) > 1)}: given twice; one recording"
            " counts once"
        )
    recordings = tuple(read_static(path, options, progress) for path in paths)
    _same(recordings)
    _alike(recordings, options)
    tuned = _tuned(recordings, family, options, progress)
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


def _tuned(
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
