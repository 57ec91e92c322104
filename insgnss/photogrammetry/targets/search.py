"""Normalised cross-correlation of a template with a window of an image."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...records import Array
from .template import Template

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
