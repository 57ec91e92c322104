"""Least-squares matching of a template with an image: (GT.2) to (GT.4)."""

from dataclasses import dataclass, replace

import numpy as np

from ...records import Array
from .template import Template

MOST_MATCHING_STEPS = 25  # beyond which a matching does not converge (chosen)
CONVERGED_PX = 1e-3  # step of the centre that ends a matching (chosen)
HUBER = 2.0  # sigmas of grey values, from which on Huber's weights fall (chosen)
CORRELATED_PX = 4.0  # of errors: the width of what the model misses (rims of shadows, stains)
_NOISE = 0.3  # largest share of white errors that a correlation is freed from: 3 sigma of contrast
_BY_CHANCE = 3.0  # of the mean square of two normal errors: 95 % are below
_BLUR_PX = (0.25, 3.0)  # of a pixel's own aperture; beyond, a target is blurred away (chosen)
SHADE = (0.15, 0.9)
"""Share of the light that the shadow of (GT.2) takes away: less is none, more leaves nothing."""
# directions, and step of the distances in pixels, of the rims that are tried
_RIM_TRIALS = 24, 1.0
# largest step of an iteration: share of the light, angle (rad), rim (px); more would leap too far
_SHADOW_STEP = np.array([[-0.2, -0.05, -1.0], [0.2, 0.05, 1.0]])
# columns of the unknowns of (GT.2): centre, deformation, log of the blur, radiometry, shadow
_C, _M, _S, _RADIOMETRY, _SHADOW = slice(0, 2), slice(2, 6), 6, slice(7, 13), slice(13, 16)


_FIRST_SCALE = np.array([[1.0, 0.0, 0.0, 1.0]]).T  # deformations, row by row
_UNEVEN = np.array([[1.0, 0.0, 0.0, -1.0], [0.0, 1.0, 1.0, 0.0]]).T  # both shears, likewise


@dataclass(frozen=True)
class Freedom:
    """Standard deviations of what the exterior orientation and level ground leave open.

    Parameters
    ----------
    size : float
        Of the scale, without unit: what the target's own size and the height leave.
    uneven : float
        Of each of both uneven parts of the deformation, without unit.
    slope : float
        Of the slopes of the ground towards east and north, which deform a target that is seen from
        the side.
    turn_rad : float
        Of the azimuth.
    blur : float
        Of the logarithm of the blur.
    """

    size: float = 0.05
    uneven: float = 0.015
    slope: float = 0.15
    turn_rad: float = 0.15
    blur: float = 0.5

    def deformation(self, template: Template) -> Array:
        """Return the covariance of a deformation M.

        Parameters
        ----------
        template : Template
            The template that it deforms.

        Returns
        -------
        ndarray, (4, 4)
            Of its components row by row. With slopes s and g the pixels by height the plane is
            taken to pixels by G + g s^T instead of G: M = I - g s^T G^-1; with a turn t on the
            ground M = I + t G J G^-1.
        """
        inverse = np.linalg.inv(template.to_pixel)
        by_slope = [np.outer(template.by_height, inverse[k]).ravel() for k in (0, 1)]
        root = np.column_stack(
            [
                self.size * _FIRST_SCALE,
                self.uneven * _UNEVEN,
                self.turn_rad * template.turn,
                self.slope * np.column_stack(by_slope),
            ]
        )
        return np.asarray(root @ root.T)


@dataclass(frozen=True, eq=False)
class Match:
    """A template matched with an image.

    Parameters
    ----------
    uv, cov : ndarray
        (2,) pixel of its centre, (2, 2) covariance, px^2.
    correlation : float
        Of the image with the template so transformed, over the pixels within the signal, freed from
        what white errors take from it: (GT.5).
    contrast : float
        Grey values between dark and bright.
    sigma_0 : float
        Standard deviation of a grey value.
    blur_px : float
        Blur that fits.
    M : ndarray
        (2, 2) what the template is deformed by.
    converged : bool
        Whether the iteration settled.
    pixels : int
        Number of pixels that took part.
    to_pixel : ndarray
        (2, 2) pixels right and down by metres along the axes of the signal as it was found.
    shade : float
        Share of the light that a shadow takes from a part of the target; 0 without one.
    M_cov : ndarray, optional
        (4, 4) covariance of M, row by row.
    edge_px : float
        What neighbouring pixels share may move each edge by so much (GT.4).
    """

    uv: Array
    cov: Array
    correlation: float
    contrast: float
    sigma_0: float
    blur_px: float
    M: Array
    converged: bool
    pixels: int
    to_pixel: Array
    shade: float = 0.0
    M_cov: Array | None = None
    edge_px: float = 0.0

    def moved_by(self, corner: Array) -> "Match":
        """Return the match in pixels of the image that its window was cut out of.

        Parameters
        ----------
        corner : ndarray, (2,)
            Upper left corner of the window, pixels.

        Returns
        -------
        Match
            The same otherwise.
        """
        return replace(self, uv=self.uv + corner)


def match(
    image: Array,
    template: Template,
    uv: Array,
    blur_px: float = 0.7,
    freedom: Freedom | None = None,
    shadow: bool = False,
) -> Match | None:
    """Match a template with an image from a first place on.

    Parameters
    ----------
    image : ndarray, (h, w)
        Grey values.
    template : Template
        The template.
    uv : ndarray, (2,)
        First place, within a pixel or two.
    blur_px : float
        First value of the blur.
    freedom : Freedom, optional
        Weights of deformation and blur.
    shadow : bool
        Whether the rim of a shadow runs through the target.

    Returns
    -------
    Match or None
        None where the signal leaves the image, or has no contrast there.
    """
    free = freedom or Freedom()
    first = np.asarray(uv, dtype=np.float64)
    state = _Shape(first, np.eye(2), np.log(blur_px), first)
    result: Match | None = None
    for _ in range(2):  # once more with the pixels about the place that was found
        around = _around(image, template, state.c)
        if around is None:
            return None
        if shadow and state.shadow is None:
            state.shadow = _first_shadow(*around, template, state)
        result = _iterated(around[0], around[1], template, state, free, np.log(blur_px))
        if result is None:
            return None
    return result


@dataclass(eq=False)
class _Shape:
    """Unknowns that are not linear: centre, deformation, logarithm of the blur; of a shadow its
    share, the direction from its rim into it and the distance of the rim from `origin`.
    """

    c: Array
    M: Array
    s: float
    origin: Array
    shadow: Array | None = None


def _around(image: Array, template: Template, c: Array) -> tuple[Array, Array] | None:
    """Pixels within a signal about c, (n, 2), and their grey values; None beyond the image."""
    reach = template.reach_px + 1.0
    low, high = np.floor(c - reach).astype(int), np.ceil(c + reach).astype(int)
    size = np.array(image.shape[::-1])
    if (low < 0).any() or (high > size).any():
        return None
    v, u = np.mgrid[low[1] : high[1], low[0] : high[0]]
    x = np.stack([u.ravel() + 0.5, v.ravel() + 0.5], axis=1)
    x = x[template.inside(x - c)]
    rows = x.astype(int)
    grey = np.asarray(image[rows[:, 1], rows[:, 0]], dtype=np.float64)
    return (x, grey) if len(x) > 2 * _SHADOW.stop else None


def _design(
    x: Array, template: Template, state: _Shape, reach: float, light: Array
) -> tuple[Array, Array]:
    """Radiometric columns (n, 6), and derivatives of T by c, M and s (n, 7), of a shaded target
    both times the light; it is blurred with its shadow, for light falls before the camera blurs.
    """
    d = x - state.c
    T, du, dv, by_s = (light * term for term in template.at(d @ state.M.T, state.s))
    if state.shadow is not None:
        k, angle, rim = state.shadow
        a = np.array([np.cos(angle), np.sin(angle)])
        across = np.linalg.solve(state.M.T, a)  # a d = across (M d)
        edge = float(rim - a @ (state.c - state.origin))
        T, du, dv = template.shaded(d @ state.M.T, state.s, float(k), across, edge)
    slope = np.stack([du, dv], axis=1)
    by_c = -slope @ state.M
    by_M = (slope[:, :, None] * d[:, None, :]).reshape(-1, 4)
    if template.signal.period_rad == 0.0:  # what the grid seems to say of its turn
        by_M -= np.outer(by_M @ template.turn, template.turn) / (template.turn @ template.turn)
    far = d / reach
    linear = np.concatenate([np.ones((len(x), 1)), far], axis=1)
    radiometry = np.concatenate([light[:, None] * linear, T[:, None] * linear], axis=1)
    return radiometry, np.concatenate([by_c, by_M, by_s[:, None]], axis=1)


def _light(x: Array, state: _Shape) -> tuple[Array, Array]:
    """Light (n,) that a shadow leaves, and its derivatives by the shadow (n, 3 or 0)."""
    if state.shadow is None:
        return np.ones(len(x)), np.empty((len(x), 0))
    from scipy.special import ndtr

    k, angle, rim = state.shadow
    width = float(np.hypot(np.exp(state.s), 0.3))  # of the blur and of a pixel
    c, s = np.cos(angle), np.sin(angle)
    d = x - state.origin
    t = (d @ np.array([c, s]) - rim) / width
    m, slope = ndtr(t), np.exp(-0.5 * t * t) / (np.sqrt(2.0 * np.pi) * width)
    by = np.stack([-m, -k * slope * (d @ np.array([-s, c])), k * slope], axis=1)
    return 1.0 - k * m, by


def _first_shadow(x: Array, grey: Array, template: Template, state: _Shape) -> Array:
    """The rim that explains most at the first place, of some directions and distances."""
    lit = np.ones(len(x))
    radiometry = _design(x, template, state, max(template.reach_px, 1.0), lit)[0]
    best, out = np.inf, np.array([0.5, 0.0, 0.0])
    for angle in np.arange(_RIM_TRIALS[0]) * 2.0 * np.pi / _RIM_TRIALS[0]:
        along = (x - state.origin) @ np.array([np.cos(angle), np.sin(angle)])
        for rim in np.arange(along.min() + 2.0, along.max() - 2.0, _RIM_TRIALS[1]):
            shadow = np.array([0.5, angle, rim])
            light = _light(x, _Shape(state.c, state.M, state.s, state.origin, shadow))[0]
            A = light[:, None] * radiometry[:, [0, 3]]
            N, b = A.T @ A, A.T @ grey
            det = N[0, 0] * N[1, 1] - N[0, 1] ** 2
            h = np.array([N[1, 1] * b[0] - N[0, 1] * b[1], N[0, 0] * b[1] - N[0, 1] * b[0]]) / det
            remaining = -float(b @ h) if h[1] > 0.0 else np.inf
            if remaining < best:
                best, out = remaining, shadow
    return out


def _prior(template: Template, free: Freedom) -> Array:
    """(16, 16) weights of deformation and blur, for errors of variance one."""
    out = np.zeros((_SHADOW.stop, _SHADOW.stop))
    out[_M, _M] = np.linalg.inv(free.deformation(template))
    out[_S, _S] = free.blur**-2
    return out


def _iterated(
    x: Array, grey: Array, template: Template, state: _Shape, free: Freedom, first_s: float
) -> Match | None:
    """The iteration over given pixels; `state` is moved."""
    unknowns = _RADIOMETRY.stop if state.shadow is None else _SHADOW.stop
    prior, reach = _prior(template, free)[:unknowns, :unknowns], max(template.reach_px, 1.0)
    w, converged = np.ones(len(x)), False
    for _ in range(MOST_MATCHING_STEPS):
        light, by_shadow = _light(x, state)
        radiometry, by = _design(x, template, state, reach, light)
        root = np.sqrt(w)
        h = np.linalg.lstsq(root[:, None] * radiometry, root * grey, rcond=None)[0]
        e = grey - radiometry @ h
        sigma = max(1.4826 * float(np.median(np.abs(e))), 1e-3 * float(np.ptp(grey)), 1e-9)
        w = np.minimum(1.0, HUBER * sigma / np.maximum(np.abs(e), 1e-300))
        gain = h[3] + (x - state.c) / reach @ h[4:6]
        shaded = (radiometry @ h / light)[:, None] * by_shadow
        J = np.concatenate([gain[:, None] * by, radiometry, shaded], axis=1)
        s2 = float((w * e * e).sum() / max(len(x) - unknowns, 1)) + 1e-12
        from_prior = np.zeros(unknowns)
        from_prior[_M], from_prior[_S] = (state.M - np.eye(2)).ravel(), state.s - first_s
        N = J.T @ (w[:, None] * J) + s2 * prior
        try:
            step = np.linalg.solve(N, J.T @ (w * e) - s2 * prior @ from_prior)
        except np.linalg.LinAlgError:
            return None
        length = float(np.hypot(*step[_C]))
        if not np.isfinite(length):
            return None
        step *= min(1.0, 1.0 / max(length, 1e-12))
        state.c = state.c + step[_C]
        state.M = state.M + step[_M].reshape(2, 2)
        state.s = float(np.clip(state.s + np.clip(step[_S], -0.5, 0.5), *np.log(_BLUR_PX)))
        if state.shadow is not None:
            state.shadow = state.shadow + np.clip(step[_SHADOW], *_SHADOW_STEP)
            state.shadow[0] = np.clip(state.shadow[0], *SHADE)
        if length < CONVERGED_PX:
            converged = True
            break
    inverse = np.linalg.inv(N)
    cov = _covariance(x, w * e, J, N, s2)
    # what neighbours share widens the errors of the deformation as it does those of the centre
    wider = max(1.0, float(np.trace(cov) / max(s2 * np.trace(inverse[_C, _C]), 1e-300)))
    width = np.sqrt(2.0 * np.pi) * np.hypot(np.exp(state.s), 0.3)  # of a blurred edge, and a pixel
    edge = _structured(x, e) * (width / max(abs(h[3]), 1e-9)) ** 2
    cov += edge * np.eye(2)
    open_ = replace(free, size=0.0, turn_rad=0.0).deformation(template)
    cov += _one_sided(template, state.M, s2 * inverse[_M, _M] + open_)
    r = _likeness(x, radiometry[:, 3] / light, grey / light, e / light)
    if not (np.isfinite(cov).all() and np.isfinite(r)):
        return None
    blur = float(np.exp(state.s))
    return Match(
        state.c.copy(),
        cov,
        r,
        float(h[3]),
        float(np.sqrt(s2)),
        blur,
        state.M.copy(),
        converged,
        len(x),
        np.asarray(np.linalg.solve(state.M, template.to_pixel), dtype=np.float64),
        0.0 if state.shadow is None else float(state.shadow[0]),
        wider * s2 * inverse[_M, _M],
        float(np.sqrt(edge)),
    )


def _one_sided(template: Template, M: Array, cov: Array) -> Array:
    """(2, 2) covariance of a centre that an outline alone tells, of an uneven deformation, with the
    covariance (4, 4) of what explains it: (GT.6).
    """
    radius = template.signal.outline_m / template.pixel_m
    p, q = 0.5 * (M[0, 0] - M[1, 1]), 0.5 * (M[0, 1] + M[1, 0])
    by = 0.5 * np.array([[1.0, 0.0, 0.0, -1.0], [0.0, 1.0, 1.0, 0.0]])
    excess = max(p * p + q * q - _BY_CHANCE * float(np.trace(by @ cov @ by.T)), 0.0)
    along = 0.5 * np.arctan2(q, p)
    t = np.array([np.cos(along), np.sin(along)])
    return np.asarray(2.0 * excess * radius**2 * np.outer(t, t))


def _likeness(x: Array, T: Array, grey: Array, e: Array) -> float:
    """Correlation of a template with grey values, less what white errors take from it."""
    whole = float(grey.var())
    if not (whole > 0.0 and np.ptp(T) > 0.0):
        return 0.0
    white = max(float((e * e).mean()) - _structured(x, e), 0.0)
    r = float(np.corrcoef(T, grey)[0, 1])
    return min(r / np.sqrt(1.0 - min(white / whole, _NOISE)), 1.0)


def _structured(x: Array, e: Array) -> float:
    """Variance of the errors that neighbouring pixels share, beyond what white errors show."""
    cells = np.floor(x - x.min(axis=0) + 0.5).astype(int)
    size = cells.max(axis=0) + 1
    grid = np.full((size[1], size[0]), np.nan)
    grid[cells[:, 1], cells[:, 0]] = e
    products = np.concatenate(
        [(grid[1:] * grid[:-1]).ravel(), (grid[:, 1:] * grid[:, :-1]).ravel()]
    )
    products = products[np.isfinite(products)]
    if not products.size:
        return 0.0
    return max(float(products.mean()) - float((e * e).mean()) / np.sqrt(products.size), 0.0)


def _covariance(x: Array, weighted: Array, J: Array, N: Array, s2: float) -> Array:
    """(2, 2) covariance of the centre: that of white errors, or (GT.3) where that is larger."""
    Q = np.linalg.inv(N)[_C]
    white = s2 * Q[:, _C]
    low = x.min(axis=0)
    cells = np.rint(x - low).astype(int)
    size = cells.max(axis=0) + 1
    score = np.zeros((size[1], size[0], 2))
    score[cells[:, 1], cells[:, 0]] = (weighted[:, None] * J) @ Q.T
    from scipy.signal import fftconvolve

    reach = np.arange(-int(CORRELATED_PX) + 1, int(CORRELATED_PX))
    triangle = 1.0 - np.abs(reach) / CORRELATED_PX
    kernel = np.outer(triangle, triangle)
    near = np.stack([fftconvolve(score[..., k], kernel, mode="same") for k in (0, 1)], axis=-1)
    S = np.einsum("ijk,ijl->kl", score, near)
    S = 0.5 * (S + S.T) * len(x) / max(len(x) - len(N), 1)
    # larger: along the axes in which the first one is a circle
    L = np.linalg.cholesky(white + 1e-18 * np.eye(2))
    Li = np.linalg.inv(L)
    values, vectors = np.linalg.eigh(Li @ S @ Li.T)
    grown = (vectors * np.maximum(values, 1.0)) @ vectors.T
    return np.asarray(L @ grown @ L.T)
