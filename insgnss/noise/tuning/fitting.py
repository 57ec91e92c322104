"""Choose a model for one sensor's axes, fit it to all recordings, judge it and describe it.

The first fit has the weights of the intervals, as the reference implementation; the second step
weighs with the inverse covariance of the wavelet variance and is worth more where the model fits.
Where the J test refuses the model, such weights would trust it further than it deserves, and the
first fit is kept.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ...base.errors import DataError, UsageError
from ...records import WaveletVariance
from ..estimation.estimates import Linearised
from ..estimation.gmwm import NoiseFit, fit
from ..estimation.goodness import GoodnessOfFit, goodness_of_fit
from ..estimation.inference import covariances, infer, second_step
from ..moments.theory import haar_variance, haar_variance_parts
from ..processes.composition import MOST_GAUSS_MARKOV, Composition
from .options import FAMILY, TuneOptions, chosen_levels
from .products.words import FITS_P, span_text
from .recordings import SENSOR_AXES, StaticRecording
from .result import Tuned
from .usable import usable_axis

if TYPE_CHECKING:
    from ..estimation.selection import Ranking

Progress = Callable[[str], None]

LEAST_DRAWS = 100  # of bootstrapped intervals
MISFIT_P = 0.001  # p-value below which the second step is not trusted
# of a bootstrap of near-stationarity, made where its p-value by theory is between this and `FITS_P`
DRAWS, DOUBTFUL_P = 40, 1e-6
# of the deviation, where a recording holds as many filter lengths: it is known to a tenth there
CLOSE, MANY_LENGTHS = 0.05, 50.0
WHITE_SCALES = 2  # at which white noise must be most of what remains
LAST_START = 12  # level up to which fine scales may be left out on advice


def compositions(options: TuneOptions) -> dict[str, tuple[Composition, ...]]:
    """Return the models that compete, by sensor.

    Raises
    ------
    UsageError
        For a typo.
    """
    opts = {"gyro": options.gyro_model, "accel": options.accel_model}
    chosen = {sensor: options.model if names is None else names for sensor, names in opts.items()}
    for names in (options.model, options.gyro_model, options.accel_model):
        if names is not None and not names.strip():
            raise UsageError(
                "a model without a name; give a sum such as WN+2GM, or leave the option out to"
                " choose from all"
            )
    return {
        sensor: tuple(
            dict.fromkeys(
                Composition.parse(name.strip())
                for name in (FAMILY if names is None else names.split(","))
            )
        )
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

    Parameters
    ----------
    sensor : str
        "gyro" or "accel".
    axes : tuple of int
        Axes, 0 to 2.
    recordings : sequence of StaticRecording
        The recordings.
    family : tuple of Composition
        Models that compete.
    options : TuneOptions
        How to fit.
    progress : callable
        Takes a line on each step.

    Returns
    -------
    Tuned
        The fit that was kept, and what it is worth.

    Raises
    ------
    UsageError
        For levels that do not exist.
    DataError
        For fewer scales than the smallest model has parameters.
    """
    name = f"{sensor} {''.join(SENSOR_AXES[k] for k in axes)}"
    curves = _curves(sensor, axes, recordings, options)
    groups = [i for _ in axes for i in range(len(recordings))]
    ranking: Ranking | None = None
    notes: tuple[str, ...] = ()
    if len(family) > 1:
        progress(f"{name}: {len(family)} models")
        ranking, notes = _ranking(curves, family, groups, options)
        chosen = ranking.chosen.composition
    else:
        chosen = family[0]
    progress(f"{name}: {chosen}")
    first = fit(curves, chosen, sampling=options.sampling)
    kept, how, goodness = _preferred_fit(first, options)
    if options.bootstrap:
        progress(f"{name}: {options.bootstrap} bootstrap replicates")
    intervals = "bootstrap" if options.bootstrap >= LEAST_DRAWS else "auto"
    inference = infer(kept, intervals=intervals, draws=options.bootstrap, seed=options.seed)
    goodness = goodness or inference.goodness
    noise, remarks = usable_axis(inference)
    option = f" --{sensor}-model {chosen}" if len(family) > 1 else ""
    finer = _finer_scales(first, goodness, inference.goodness.misfits, option, options)
    remarks = (*notes, *remarks, *finer)
    stationarity = None
    if len(recordings) > 1:
        from ..estimation.near_stationarity import near_stationarity

        progress(f"{name}: does one model serve all recordings?")
        stationarity = near_stationarity(
            kept, recordings=groups, draws=options.bootstrap, seed=options.seed
        )
        if not options.bootstrap and DOUBTFUL_P < stationarity.p_value < FITS_P:
            stationarity = near_stationarity(
                kept, recordings=groups, draws=DRAWS, seed=options.seed
            )
    return Tuned(
        sensor=sensor,
        axes=axes,
        first=first,
        kept=kept,
        inference=inference,
        goodness=goodness,
        how=how,
        noise=noise,
        remarks=remarks,
        ranking=ranking,
        stationarity=stationarity,
    )


def _curves(
    sensor: str, axes: tuple[int, ...], recordings: Sequence[StaticRecording], options: TuneOptions
) -> list[WaveletVariance]:
    """Curves axis by axis, recording by recording, of the chosen levels."""
    curves = [r.curves[sensor, k] for k in axes for r in recordings]
    levels = chosen_levels(options.levels, max(int(curve.level[-1]) for curve in curves))
    if levels is None:
        return curves
    for curve, r in zip(curves, [r for _ in axes for r in recordings], strict=True):
        if int(curve.level[-1]) < levels[0]:
            raise UsageError(
                f"--levels {options.levels}: {r.name} has levels 1 to {int(curve.level[-1])} only;"
                " give some of these"
            )
    return [curve.selected(levels) for curve in curves]


def _few_enough(
    family: Sequence[Composition], curves: Sequence[WaveletVariance]
) -> list[Composition]:
    """Return the models with fewer parameters than there are scales."""
    scales = max(curve.level.size for curve in curves)
    small_enough = [composition for composition in family if composition.size < scales]
    if not small_enough:
        raise DataError(
            f"{scales} scales are too few for {family[0]} and all others; record longer or take"
            " more levels"
        )
    return small_enough


def _ranking(
    curves: list[WaveletVariance],
    family: Sequence[Composition],
    groups: list[int],
    options: TuneOptions,
) -> "tuple[Ranking, tuple[str, ...]]":
    """Rank the models by their criterion, with notes on how.

    The weights are those of the intervals where V is singular.
    """
    from ..estimation.selection import rank

    candidates = [c for c in _few_enough(family, curves) if c.size > c.drift] or list(family)
    notes: tuple[str, ...] = ()
    if out := [str(composition) for composition in family if composition not in candidates]:
        why = "for more parameters than the scales determine or no noise at all"
        notes = (f"not tried, {why}: {', '.join(out)}",)
    ranked = partial(rank, recordings=groups, sampling=options.sampling, below_a_sample=False)
    try:
        return ranked(curves, candidates), notes
    except UsageError:
        why = "the covariance of scales that hardly differ is singular"
        notes += (f"the models are compared with the weights of the intervals: {why}",)
        return ranked(curves, candidates, weights="interval"), notes


def _preferred_fit(
    first: NoiseFit, options: TuneOptions
) -> tuple[NoiseFit, str, GoodnessOfFit | None]:
    """Return the fit that is worth more, a sentence that says which, and a test.

    The test is that of the efficient fit where that was not kept.
    """
    if options.weights == "diagonal":
        return first, "weights of the intervals, as requested", None
    second, sentence, settled = second_step(first)
    if second is first or options.weights == "full":
        return second, sentence, None
    reason = "weights of the intervals kept: efficient ones"
    if not settled:
        return first, f"{reason} do not settle, as happens where the model does not fit", None
    goodness = _j_test(second)
    if _has_test(goodness) and goodness.p_value < MISFIT_P:
        return first, f"{reason} would trust a model that does not fit", goodness
    return second, sentence, None


def _finer_scales(
    first: NoiseFit,
    goodness: GoodnessOfFit,
    misfits: Sequence[tuple[int, int]],
    model_option: str,
    options: TuneOptions,
) -> tuple[str, ...]:
    """Advise from which level on the model fits, where fine scales keep it from fitting.

    It fits by the test, or within `CLOSE`. Scales that determine the white noise are not advised
    away: where those that remain no longer do, or where the model of those that remain has less
    noise at the scales left out than was measured there, nothing is advised.

    misfits : curve and level of the scales that stand out; to start above none of them would be no
        remedy.
    model_option : option that names the model, where it was chosen of several: another might be
        chosen with other levels.
    """
    if not _has_test(goodness) or goodness.p_value >= FITS_P or options.levels is not None:
        return ()
    slow = _advise_slow_misfit(first, misfits)
    if slow:
        return (slow,)
    name = str(first.composition)
    close = ""
    for start in range(2, LAST_START + 1):
        levels = [j for j in first.curves[0].level.tolist() if j >= start]
        if len(levels) <= first.composition.size:
            break
        if misfits and start <= min(j for _, j in misfits):
            continue
        coarser = fit(first.curves, first.composition, sampling=first.sampling, levels=levels)
        if not _determines_white_noise(coarser, first.curves):
            return (close or _advise_fine_misfit(first.composition),)
        scale = f"{float(coarser.curves[0].scale_s[0]):.3g} s"
        option = f"--levels {start}-{model_option}"
        if not close and _largest_deviation(coarser) < CLOSE:
            close = (
                f"from scale {scale} on {name} is within {CLOSE:.0%} of the deviation: {option}"
                " leaves the finer scales out"
            )
        p = _tested_p(coarser, options)
        if p >= FITS_P:
            fits = f"from scale {scale} on {name} fits (p = {p:.2g}): {option}"
            if close and option not in close:
                return (close, fits)
            return (f"{fits} leaves the finer scales out",)
    return (close or f"leaving out fine scales does not make {name} fit",)


def _advise_fine_misfit(composition: Composition) -> str:
    """Advise what to try where the misfit is at scales that determine the white noise."""
    models = _larger_models(composition, "quantization")
    advice = f"; add a short process: --model {models}" if models else ""
    return (
        "fine scales that do not fit are among those that determine the white noise, and are not to"
        f" be left out{advice}"
    )


def _determines_white_noise(coarser: NoiseFit, curves: Sequence[WaveletVariance]) -> bool:
    """Tell whether a fit without its finest scales still knows the white noise.

    That is so where white noise (and rounding) is most of the wavelet variance at `WHITE_SCALES` of
    the scales that remain, and what the model then says of the scales left out is no less than was
    measured there, within `CLOSE` of the deviation: a filter of the sensor takes from them, while
    noise that the model lacks adds to them.
    """
    if not coarser.axis.white_noise:
        return not coarser.composition.white_noise
    for all_scales, coarse_scales in zip(curves, coarser.curves, strict=True):
        variance_of = haar_variance_parts(
            coarser.axis, coarse_scales.level, coarse_scales.rate_hz, coarser.sampling
        )
        white = variance_of["white_noise"] + variance_of.get("quantization", 0.0)
        if np.count_nonzero(white > 0.5 * sum(variance_of.values())) < WHITE_SCALES:
            return False
        left_out = all_scales.level < coarse_scales.level[0]
        modelled = haar_variance(
            coarser.axis, all_scales.level[left_out], all_scales.rate_hz, coarser.sampling
        )
        if (np.sqrt(modelled / all_scales.variance[left_out]) < 1.0 - CLOSE).any():
            return False
    return True


def _advise_slow_misfit(fitted: NoiseFit, misfits: Sequence[tuple[int, int]]) -> str:
    """Advise what to try where all scales that stand out are long ones; else return nothing.

    Long ones lie in the upper half of the levels.
    """
    middle = float(np.mean([curve.level[[0, -1]].mean() for curve in fitted.curves]))
    if not misfits or min(j for _, j in misfits) <= middle:
        return ""
    scales = [2.0**j / fitted.curves[i].rate_hz for i, j in misfits]
    models = _larger_models(fitted.composition, "random_walk")
    advice = (
        f"add a slow process: --model {models}" if models else "look for a drift or a disturbance"
    )
    return (
        f"the misfit is at long scales, {span_text(scales)}, and leaving out fine ones does not"
        f" cure it; {advice}"
    )


def _larger_models(composition: Composition, process: str) -> str:
    """Name the models with one more Gauss-Markov process, and with `process` besides."""
    models = []
    if composition.gauss_markov < MOST_GAUSS_MARKOV:
        models.append(replace(composition, gauss_markov=composition.gauss_markov + 1))
    if not getattr(composition, process):
        models.append(replace(composition, **{process: True}))
    return " or ".join(map(str, models))


def _tested_p(fitted: NoiseFit, options: TuneOptions) -> float:
    """Return the p-value that tuning on these levels would report.

    It is NaN without a test, and that of the weights of the intervals where it is small.
    """
    test = _j_test(fitted)
    if _has_test(test) and test.p_value >= MISFIT_P:  # the efficient test is better, and slower
        preferred, _, goodness = _preferred_fit(fitted, options)
        test = goodness or _j_test(preferred)
    return test.p_value if _has_test(test) else float("nan")


def _largest_deviation(fitted: NoiseFit) -> float:
    """Return the largest relative error of the modelled deviation.

    It is taken over the scales of which a recording holds many.
    """
    deviations = [0.0]
    for curve, modelled in zip(fitted.curves, fitted.modelled, strict=True):
        well_averaged = curve.count > MANY_LENGTHS * 2.0**curve.level
        deviations += np.abs(
            np.sqrt(modelled[well_averaged] / curve.variance[well_averaged]) - 1.0
        ).tolist()
    return max(deviations)


def _j_test(fitted: NoiseFit) -> GoodnessOfFit:
    """Return the J test alone of all that `infer` gives."""
    return goodness_of_fit(fitted, Linearised(fitted, covariances(fitted)))


def _has_test(goodness: GoodnessOfFit) -> bool:
    return bool(goodness.degrees > 0 and np.isfinite(goodness.p_value))
