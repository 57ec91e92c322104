"""One sensor's axes: choose a model, fit it to all recordings, judge it, and say in words what was found.

The first fit has the weights of the intervals, as the reference implementation; the second step weighs with the inverse covariance of the
wavelet variance and is worth more where the model fits. Where the J test refuses the model, such weights would trust it further than it
deserves, and the first fit is kept.
"""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..errors import DataError, UsageError
from ..records import WaveletVariance
from ..stochastic.composition import Composition
from ..stochastic.gmwm import Fit, fit
from ..stochastic.goodness import GoodnessOfFit
from ..stochastic.inference import infer, second_step
from .options import FAMILY, TuneOptions, chosen_levels
from .recordings import AXES, StaticRecording
from .result import Tuned
from .usable import usable_axis
from .words import FITS

if TYPE_CHECKING:
    from ..stochastic.selection import Ranking

Progress = Callable[[str], None]

LEAST_DRAWS = 100  # of bootstrapped intervals
MISFIT = 0.001  # p-value below which the second step is not trusted
DRAWS, DOUBTFUL = 40, 1e-6  # of a bootstrap of near-stationarity, made where its p-value by theory lies between this and `FITS`
CLOSE, MANY = 0.05, 50.0  # of the deviation, where a recording holds as many filter lengths: it is known to a tenth there
LAST_START = 12  # level up to which fine scales may be left out on advice


def compositions(options: TuneOptions) -> dict[str, tuple[Composition, ...]]:
    """The models that compete, by sensor. Raises UsageError for a typo."""
    chosen = {"gyro": options.gyro_model or options.model, "accel": options.accel_model or options.model}
    return {
        sensor: tuple(dict.fromkeys(Composition.parse(name.strip()) for name in (names.split(",") if names else FAMILY)))
        for sensor, names in chosen.items()
    }


def tune_axes(
    sensor: str,
    axes: tuple[int, ...],
    recordings: Sequence[StaticRecording],
    family: tuple[Composition, ...],
    options: TuneOptions,
    progress: Progress,
) -> Tuned:
    """Fit the axes of a sensor over all recordings with one set of parameters.

    Raises UsageError for levels that are not there, DataError where there are fewer scales than the smallest model has parameters.
    """
    name = f"{sensor} {''.join(AXES[k] for k in axes)}"
    curves = _curves(sensor, axes, recordings, options)
    groups = [i for _ in axes for i in range(len(recordings))]
    ranking = None
    if len(family) > 1:
        progress(f"{name}: {len(family)} models")
        ranking = _ranking(curves, _few_enough(family, curves), groups, options)
        chosen = ranking.chosen.composition
    else:
        chosen = family[0]
    progress(f"{name}: {chosen}")
    first = fit(curves, chosen, sampling=options.sampling)
    kept, how, goodness = _kept(first, options)
    if options.bootstrap:
        progress(f"{name}: {options.bootstrap} bootstrap replicates")
    intervals = "bootstrap" if options.bootstrap >= LEAST_DRAWS else "auto"
    inference = infer(kept, intervals=intervals, draws=options.bootstrap, seed=options.seed)
    goodness = goodness or inference.goodness
    noise, remarks = usable_axis(inference)
    remarks += _finer_scales(first, goodness, options)
    stationarity = None
    if len(recordings) > 1:
        from ..stochastic.selection import near_stationarity

        progress(f"{name}: does one model serve all recordings?")
        stationarity = near_stationarity(kept, recordings=groups, draws=options.bootstrap, seed=options.seed)
        if not options.bootstrap and DOUBTFUL < stationarity.p_value < FITS:
            stationarity = near_stationarity(kept, recordings=groups, draws=DRAWS, seed=options.seed)
    return Tuned(sensor, axes, first, kept, inference, goodness, how, noise, remarks, ranking, stationarity)


def _curves(sensor: str, axes: tuple[int, ...], recordings: Sequence[StaticRecording], options: TuneOptions) -> list[WaveletVariance]:
    """Curves axis by axis, recording by recording, of the chosen levels."""
    curves = [r.curves[sensor, k] for k in axes for r in recordings]
    levels = chosen_levels(options.levels, max(int(curve.level[-1]) for curve in curves))
    if levels is None:
        return curves
    for curve, r in zip(curves, [r for _ in axes for r in recordings], strict=True):
        if int(curve.level[-1]) < levels[0]:
            raise UsageError(f"--levels {options.levels}: {r.name} has levels 1 to {int(curve.level[-1])} only")
    return [curve.selected(levels) for curve in curves]


def _few_enough(family: Sequence[Composition], curves: Sequence[WaveletVariance]) -> list[Composition]:
    """Those with fewer parameters than there are scales."""
    scales = max(curve.level.size for curve in curves)
    left = [composition for composition in family if composition.size < scales]
    if not left:
        raise DataError(f"{scales} scales are too few for {family[0]} and all others; record longer or take more levels")
    return left


def _ranking(curves: list[WaveletVariance], family: list[Composition], groups: list[int], options: TuneOptions) -> "Ranking":
    """The models by their criterion; with the weights of the intervals where the efficient ones cannot be had."""
    from ..stochastic.selection import rank

    try:
        return rank(curves, family, recordings=groups, sampling=options.sampling)
    except UsageError:  # a singular covariance, of scales that hardly differ
        return rank(curves, family, weights="interval", recordings=groups, sampling=options.sampling)


def _kept(first: Fit, options: TuneOptions) -> tuple[Fit, str, GoodnessOfFit | None]:
    """The fit that is worth more, a sentence that says which, and the test of the efficient one where that was not kept."""
    if options.weights == "diagonal":
        return first, "weights of the intervals, as asked", None
    second, said = second_step(first)
    if second is first or options.weights == "full":
        return second, said, None
    if "not settled" in said:
        return first, "weights of the intervals kept: efficient ones do not settle, as happens where the model does not fit", None
    goodness = infer(second).goodness
    if _tested(goodness) and goodness.p_value < MISFIT:
        return first, "weights of the intervals kept: efficient ones would trust a model that does not fit", goodness
    return second, said, None


def _finer_scales(first: Fit, goodness: GoodnessOfFit, options: TuneOptions) -> tuple[str, ...]:
    """From which level on the model fits, by the test and within `CLOSE`, where it does not fit them all."""
    if not _tested(goodness) or goodness.p_value >= FITS or options.levels is not None:
        return ()
    name, close = str(first.composition), ""
    for start in range(2, LAST_START + 1):
        levels = [j for j in first.curves[0].level.tolist() if j >= start]
        if len(levels) <= first.composition.size:
            break
        part = fit(first.curves, first.composition, sampling=first.sampling, levels=levels)
        scale = f"{float(part.curves[0].scale_s[0]):.3g} s"
        if not close and _farthest(part) < CLOSE:
            close = f"from scale {scale} on {name} is within {CLOSE:.0%} of the deviation: --levels {start}- leaves the finer scales out"
        test = infer(second_step(part)[0] if options.weights != "diagonal" else part).goodness
        if _tested(test) and test.p_value >= FITS:
            fits = f"from scale {scale} on {name} fits (p = {test.p_value:.2g}): --levels {start}-"
            return (close, fits) if close and f"--levels {start}-" not in close else (f"{fits} leaves the finer scales out",)
    return (close or f"leaving out fine scales does not make {name} fit",)


def _farthest(fitted: Fit) -> float:
    """Largest relative error of the modelled deviation, over the scales of which a recording holds many."""
    off = [0.0]
    for curve, modelled in zip(fitted.curves, fitted.modelled, strict=True):
        many = curve.count > MANY * 2.0**curve.level
        off += np.abs(np.sqrt(modelled[many] / curve.variance[many]) - 1.0).tolist()
    return max(off)


def _tested(goodness: GoodnessOfFit) -> bool:
    return bool(goodness.degrees > 0 and np.isfinite(goodness.p_value))
