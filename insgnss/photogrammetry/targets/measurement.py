"""One target in one image: search, matching, and the rules that reject what is no target.

The search is a normalised cross-correlation of the template with the window.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...base.errors import InputError
from ...records import Array
from .matching import Freedom, Match, match
from .signals import Signal
from .template import Template, rotated_axes

_MOST_PLACES = 3  # of the best, which the matching tries: one is the target, one its rival
_APART_PX = 3.0  # between places: the matching finds what is nearer


@dataclass(frozen=True, eq=False)
class Peak:
    """A place of a template in a window, at whole pixels.

    Parameters
    ----------
    correlation, second : float
        Correlation there, and at the best place farther away, -1 where there is none.
    uv : ndarray
        (2,) middle of the pixel, in pixels of the image.
    template : Template
        The template that fits best.
    """

    correlation: float
    second: float
    uv: Array
    template: Template


def correlation_maps(window: Array, templates: Sequence[Template], blur_px: float) -> Array:
    """Return the normalised cross-correlation of the pixels within a signal, in several azimuths.

    Its pixels are the same in all of them, and so is what the window has of them.

    Parameters
    ----------
    window : ndarray, (h, w)
        Grey values.
    templates : sequence of Template
        The k templates.
    blur_px : float
        Their blur.

    Returns
    -------
    ndarray, (k, h, w)
        Correlation with the signal centred on each pixel; NaN where it leaves the window, zero
        where the window is of one grey value.
    """
    from scipy.fft import irfft2, next_fast_len, rfft2

    half = int(np.ceil(max(t.reach_px for t in templates) - 1e-9))
    out = np.full((len(templates), *window.shape), np.nan)
    if min(window.shape) < 2 * half + 1:
        return out
    steps = np.arange(-half, half + 1.0)
    d = np.stack(np.meshgrid(steps, steps), axis=-1)
    w = templates[0].inside(d).astype(np.float64)
    I = window - window.mean()
    shape = [next_fast_len(n, real=True) for n in window.shape]
    rows, columns = (n - 2 * half for n in window.shape)

    def summed(transformed: NDArray[np.complex128], kernel: Array) -> Array:
        """Sums of a window times a kernel, with the kernel wholly within the window."""
        product = transformed * np.conj(rfft2(kernel, shape))
        return np.asarray(irfft2(product, shape)[:rows, :columns])

    F = rfft2(I, shape)
    power = summed(rfft2(I * I, shape), w) - summed(F, w) ** 2 / w.sum()
    floor = 1e-9 * max(float((I * I).mean()) * w.sum(), 1e-300)
    inner = slice(half, -half or None)
    for k, template in enumerate(templates):
        T = template.blurred(blur_px).value(d.reshape(-1, 2)).reshape(w.shape)
        T = w * (T - (w * T).sum() / w.sum())
        whole = summed(F, T) / np.sqrt(np.maximum(power, floor) * (T * T).sum())
        out[k, inner, inner] = np.where(power > floor, whole, 0.0)
    return out


def find(
    window: Array,
    corner: tuple[int, int],
    templates: list[Template],
    blur_px: float,
    uv: Array,
    cov: Array,
    gate: float,
) -> list[Peak]:
    """Find the best places of some templates within the ellipse of a prediction.

    Parameters
    ----------
    window : ndarray, (h, w)
        Grey values.
    corner : tuple of int
        Column and row of the image at which the window begins.
    templates : list of Template
        One signal in several azimuths.
    blur_px : float
        Their blur.
    uv, cov : ndarray, (2,), (2, 2)
        The prediction, in pixels of the image.
    gate : float
        Size of the ellipse, sigmas.

    Returns
    -------
    list of Peak
        From the best on, some pixels apart; none where no pixel of the window can be the centre.
    """
    maps = correlation_maps(window, templates, blur_px)
    best = np.max(np.where(np.isfinite(maps), maps, -np.inf), axis=0)
    v, u = np.indices(window.shape)
    d = np.stack([u + 0.5 + corner[0], v + 0.5 + corner[1]], axis=-1) - uv
    wide = cov + 0.5 * np.eye(2)  # places are whole pixels
    best[np.einsum("...i,ij,...j", d, np.linalg.inv(wide), d) > gate**2] = -np.inf
    peaks: list[Peak] = []
    open_ = np.isfinite(best)
    while len(peaks) < _MOST_PLACES and open_.any():
        row, column = (
            int(k) for k in np.unravel_index(np.where(open_, best, -2.0).argmax(), v.shape)
        )
        which = int(np.nanargmax(maps[:, row, column]))
        far = np.hypot(v - row, u - column)
        away = far > max(1.5 * templates[which].reach_px, 3.0)
        second = float(np.max(best, where=away, initial=-1.0))
        centre = np.array([column + 0.5 + corner[0], row + 0.5 + corner[1]])
        peaks.append(Peak(float(best[row, column]), second, centre, templates[which]))
        open_ &= far > _APART_PX
    return peaks


WIDE_PX = 16.0  # radius of a signal from which on its places are less sharp in proportion
_SHADOW_EXPLAINS = 0.6  # of what is left without it, for three unknowns in 150 pixels
_SHADOW_FROM = 0.75  # correlation below which a shadow cannot be all that is wrong
_SMALLEST_PX = 4.0  # of the radius of a signal: below, its rim is all that is left of it


@dataclass(frozen=True)
class Rules:
    """Limits of a measurement.

    Parameters
    ----------
    gate : float
        Sigmas of the prediction within which the target is looked for.
    found : float
        Smallest correlation of the search.
    correlation : float
        Smallest correlation of the matching: by (GT.5) and (GT.4) what 0.98 leaves may move an edge
        of 0.7 px blur by 0.2 px, all that the method promises.
    clear : float
        Correlation above which no shadow is looked for.
    ambiguous : float
        The second best place must correlate by so much less than the best.
    contrast : float
        Smallest contrast, in standard deviations of a grey value: white noise of a fifth moves the
        centre of a target of 150 pixels by 0.05 px.
    sigma_px : float
        Largest standard deviation of a coordinate, pixels.
    moved : float
        Largest distance of the match from the place of the search, pixels; of larger targets
        more in proportion (`WIDE_PX`).
    deformed : float
        Largest deformation, root mean square of its four components in standard deviations of
        `freedom`: one good target in 10 000 is lost.
    step_rad : float
        Step of the azimuths that are tried where the azimuth is not known.
    blur_px : float
        Blur that the matching starts from.
    freedom : Freedom
        What exterior orientation and level ground leave open.
    """

    gate: float = 3.7
    found: float = 0.75
    correlation: float = 0.98
    clear: float = 0.997
    ambiguous: float = 0.03
    contrast: float = 5.0
    sigma_px: float = 0.4
    moved: float = 2.5
    deformed: float = 2.4
    step_rad: float = np.pi / 12.0
    blur_px: float = 0.7
    freedom: Freedom = field(default_factory=Freedom)


@dataclass(frozen=True, eq=False)
class MeasuredTarget:
    """What became of a target in an image.

    Parameters
    ----------
    rejected : str
        Why it is no measurement, with the number and its limit; empty for one that stands.
    match : Match or None
        What was matched, also where it was rejected; None where the search found nothing.
    correlation, second : float
        Of the search, at the best place and elsewhere; NaN where there was no place.
    distance : float
        Of the match from the prediction, in standard deviations of both; NaN without match.
    rule : str
        The rule by which it is no measurement, the same for all that it rejects.
    """

    rejected: str
    match: Match | None
    correlation: float = np.nan
    second: float = np.nan
    distance: float = np.nan
    rule: str = ""

    @property
    def accepted(self) -> bool:
        """Whether it is a measurement."""
        return not self.rejected


def measure(
    image: ArrayLike,
    signal: Signal,
    uv: ArrayLike,
    cov: ArrayLike,
    by_point: ArrayLike,
    azimuth_rad: float | None = None,
    rules: Rules | None = None,
) -> MeasuredTarget:
    """Measure a target where it is predicted.

    Parameters
    ----------
    image : array_like, (h, w)
        Grey values of the whole image.
    signal : Signal
        What the target looks like.
    uv, cov, by_point : array_like, (2,), (2, 2), (2, 3)
        A row of `prediction.Predictions`.
    azimuth_rad : float, optional
        Azimuth of the target; without it all are tried.
    rules : Rules, optional
        Limits.

    Returns
    -------
    MeasuredTarget
        The measurement, or why there is none.

    Raises
    ------
    InputError
        An image that is not two-dimensional, or a prediction that is not finite.
    """
    limits = rules or Rules()
    grey = np.asarray(image)
    expected, C, B = (np.asarray(a, dtype=np.float64) for a in (uv, cov, by_point))
    if grey.ndim != 2:
        raise InputError(f"image of a target: shape {grey.shape}; grey values of rows and columns")
    if not all(np.isfinite(a).all() for a in (expected, C, B)):
        raise InputError(
            "prediction of a target: not finite; pass the predictions of visible points only"
        )
    templates = [
        Template(signal, rotated_axes(B, angle), B[:, 2])
        for angle in _azimuths(signal, azimuth_rad, limits)
    ]
    if (radius := signal.radius_m / templates[0].pixel_m) < _SMALLEST_PX:
        rule = f"radius below {_SMALLEST_PX:g} px: too small in this image"
        why = f"radius {radius:.1f} px, below {_SMALLEST_PX:g}: too small in this image"
        return MeasuredTarget(why, None, rule=rule)
    reach = int(np.ceil(max(t.reach_px for t in templates))) + 2
    wide = limits.gate * np.sqrt(np.diagonal(C) + 0.5) + reach
    low = np.maximum(np.floor(expected - wide).astype(int), 0)
    high = np.minimum(np.ceil(expected + wide).astype(int), grey.shape[::-1])
    window = grey[low[1] : max(high[1], low[1]), low[0] : max(high[0], low[0])].astype(np.float64)
    corner = (int(low[0]), int(low[1]))
    peaks = (
        find(window, corner, templates, limits.blur_px, expected, C, limits.gate)
        if window.size
        else []
    )
    if not peaks:
        why = "the signal would leave the image"
        return MeasuredTarget(why, None, rule=why)
    if (first := peaks[0]).correlation < limits.found:
        why = f"correlation {first.correlation:.2f} of the search, below {limits.found:g}"
        rule = f"correlation of the search below {limits.found:g}"
        return MeasuredTarget(why, None, first.correlation, first.second, rule=rule)
    likely = [p for p in peaks if p.correlation >= limits.found]
    best = _best(window, corner, likely, limits)
    if best is None:
        why = "the matching has no solution within the image"
        return MeasuredTarget(why, None, first.correlation, first.second, rule=why)
    peak, result = best
    difference = result.uv - expected
    distance = float(np.sqrt(difference @ np.linalg.solve(C + result.cov, difference)))
    rule, why = _broken_rule(peak, result, distance, limits)
    return MeasuredTarget(why, result, peak.correlation, peak.second, distance, rule)


def _best(
    window: Array, corner: tuple[int, int], peaks: list[Peak], rules: Rules
) -> tuple[Peak, Match] | None:
    """The place whose match correlates best; with a shadow where none does well without."""
    low = np.array(corner, dtype=np.float64)

    def matched(shadow: bool) -> tuple[Peak, Match] | None:
        pairs: list[tuple[Peak, Match]] = []
        for p in peaks:
            near = 0.5 * p.template.reach_px
            if any(
                m.converged
                and m.correlation > rules.correlation
                and np.hypot(*(p.uv - m.uv)) < near
                for _, m in pairs
            ):
                continue  # the same target, from another of its places
            m = match(window, p.template, p.uv - low, rules.blur_px, rules.freedom, shadow=shadow)
            if m is not None:
                pairs.append((p, m.moved_by(low)))
        return max(pairs, key=lambda pair: (pair[1].converged, pair[1].correlation), default=None)

    plain = matched(False)
    if plain is not None and plain[1].converged and plain[1].correlation > rules.clear:
        return plain
    if plain is not None and plain[1].correlation < _SHADOW_FROM:
        return plain
    shaded = matched(True)
    if shaded is None or not shaded[1].converged or plain is None or not plain[1].converged:
        return shaded if shaded is not None and (plain is None or shaded[1].converged) else plain
    unexplained = [1.0 - m.correlation**2 for m in (shaded[1], plain[1])]
    return shaded if unexplained[0] < _SHADOW_EXPLAINS * unexplained[1] else plain


def _azimuths(signal: Signal, azimuth_rad: float | None, rules: Rules) -> Array:
    if azimuth_rad is not None or signal.period_rad == 0.0:
        return np.array([azimuth_rad or 0.0])
    count = max(int(np.ceil(signal.period_rad / rules.step_rad - 1e-9)), 1)
    return np.arange(count) * signal.period_rad / count


def _broken_rule(peak: Peak, result: Match, distance: float, rules: Rules) -> tuple[str, str]:
    """The first rule that a match breaks, and the same with its number; two empty texts of none."""
    sigma = float(np.sqrt(np.linalg.eigvalsh(result.cov)[-1]))
    contrast = result.contrast / result.sigma_0
    moved = float(np.hypot(*(result.uv - peak.uv)))
    far = rules.moved * max(1.0, peak.template.reach_px / WIDE_PX)
    deformed = deformation(result.M, rules.freedom.deformation(peak.template))
    for broken, rule, reason in (
        (not result.converged, "matching not converged", "the matching has not converged"),
        (
            result.correlation < rules.correlation,
            f"correlation below {rules.correlation:g}",
            f"correlation {result.correlation:.3f}, below {rules.correlation:g}",
        ),
        (
            contrast < rules.contrast,
            f"contrast below {rules.contrast:g} sigmas of a grey value",
            f"contrast {contrast:.1f} sigmas of a grey value, below {rules.contrast:g}",
        ),
        (
            sigma > rules.sigma_px,
            f"sigma above {rules.sigma_px:g} px",
            f"sigma {sigma:.2f} px, above {rules.sigma_px:g}",
        ),
        (
            moved > far,
            "matched too far from its place",
            f"matched {moved:.1f} px from its place, above {far:.1f}",
        ),
        (
            deformed > rules.deformed,
            f"deformed by more than {rules.deformed:g} sigmas",
            f"deformed {deformed:.1f} sigmas, above {rules.deformed:g}",
        ),
        (
            distance > rules.gate,
            f"more than {rules.gate:g} sigmas from its prediction",
            f"{distance:.1f} sigmas from its prediction, above {rules.gate:g}",
        ),
        (
            peak.correlation - peak.second < rules.ambiguous,
            "another place that matches as well",
            f"a second place correlates by {peak.second:.2f}, this one by {peak.correlation:.2f}",
        ),
    ):
        if broken:
            return rule, reason
    return "", ""


def deformation(M: Array, cov: Array) -> float:
    """Return the size of a deformation in standard deviations of what is open.

    Parameters
    ----------
    M : ndarray, (2, 2)
        The deformation; I is none.
    cov : ndarray, (4, 4)
        Covariance of what is open, row by row.

    Returns
    -------
    float
        Root of the mean square of its four components in units of their covariance.
    """
    d = (M - np.eye(2)).ravel()
    return float(np.sqrt(d @ np.linalg.solve(cov, d) / 4.0))
