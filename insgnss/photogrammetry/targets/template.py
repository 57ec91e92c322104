"""A signal to the scale and the rotation of an image."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...records import Array
from .signals import Signal

OVERSAMPLING = 5  # points in a pixel, odd, so that the mean over a pixel lies in its middle
# of the logarithm of the blur: between levels the template is linear to 1e-3 of it
LEVEL_LOG_BLUR = 0.1
_SIGNAL_BORDER_PX = 6.0  # about the signal, so that what the matching moves stays on the grid
EDGE_PX = 1.2  # at the rim of the signal where blur mixes it with what is about it


@dataclass(frozen=True, eq=False)
class Template:
    """A signal in one image.

    Parameters
    ----------
    signal : Signal
        The signal.
    to_pixel : ndarray
        (2, 2) pixels right and down by metres along the signal's own axes; its azimuth is in it.
    by_height : ndarray
        (2,) pixels right and down by metres of height.
    """

    signal: Signal
    to_pixel: Array
    by_height: Array = field(default_factory=lambda: np.zeros(2))

    @property
    def pixel_m(self) -> float:
        """Mean ground sampling distance, m."""
        return float(1.0 / np.sqrt(abs(np.linalg.det(self.to_pixel))))

    @property
    def reach_px(self) -> float:
        """Largest distance of a point of the signal from its centre, pixels."""
        return float(self.signal.radius_m * np.linalg.norm(self.to_pixel, 2))

    @property
    def turn(self) -> Array:
        """(4,) deformation in the image, row by row, by a turn on the ground, 1/rad."""
        J = np.array([[0.0, 1.0], [-1.0, 0.0]])
        return np.asarray(self.to_pixel @ J @ np.linalg.inv(self.to_pixel)).ravel()

    def inside(self, d: Array) -> NDArray[np.bool_]:
        """Return which pixels lie within the signal, its rim excluded.

        Parameters
        ----------
        d : ndarray, (..., 2)
            Pixels from the centre.

        Returns
        -------
        ndarray of bool, (...)
            Which.
        """
        ground = d @ np.linalg.inv(self.to_pixel).T
        limit = self.signal.radius_m - EDGE_PX * self.pixel_m
        return np.asarray(np.hypot(ground[..., 0], ground[..., 1]) < limit)

    @cached_property
    def _cells(self) -> tuple[Array, Array]:
        """Pixels right and down of a grid of `OVERSAMPLING` points in a pixel, symmetric about the
        centre and without a point in it.
        """
        half = int(np.ceil((self.reach_px + _SIGNAL_BORDER_PX) * OVERSAMPLING))
        cells = (np.arange(2 * half) - half + 0.5) / OVERSAMPLING
        u, v = np.meshgrid(cells, cells)
        return u, v

    @cached_property
    def _drawn(self) -> Array:
        """The signal on the grid."""
        inverse = np.linalg.inv(self.to_pixel)
        e, n = np.moveaxis(np.stack(self._cells, axis=-1) @ inverse.T, -1, 0)
        return self.signal.value(e, n)

    @cached_property
    def _sharp(self) -> Array:
        """The signal on the grid, averaged over pixels."""
        from scipy.ndimage import uniform_filter

        return np.asarray(uniform_filter(self._drawn, OVERSAMPLING, mode="nearest"))

    def shaded(
        self, d: Array, log_blur: float, share: float, across: Array, rim: float
    ) -> tuple[Array, Array, Array]:
        """Return values and derivatives under a shadow, which falls before the camera blurs.

        Parameters
        ----------
        d : ndarray, (n, 2)
            Pixels from the centre.
        log_blur : float
            Logarithm of the standard deviation of the Gaussian that blurs, pixels.
        share : float
            Share of the light that the shadow takes.
        across : ndarray, (2,)
            Direction from its rim into it; the rim is where d times it is `rim`.
        rim : float
            Distance of the rim, in units of the length of `across`.

        Returns
        -------
        value, du, dv : ndarray, (n,)
            The value of signal times light, and its derivatives by both coordinates, 1/px.
        """
        from scipy.ndimage import gaussian_filter, uniform_filter

        u, v = self._cells
        beyond = (across[0] * u + across[1] * v - rim) * OVERSAMPLING / np.linalg.norm(across)
        light = 1.0 - share * np.clip(beyond + 0.5, 0.0, 1.0)
        sharp = uniform_filter(self._drawn * light, OVERSAMPLING, mode="nearest")
        blurred = gaussian_filter(sharp, np.exp(log_blur) * OVERSAMPLING, mode="nearest")
        return Sampled(np.asarray(blurred)).at(d)

    @cached_property
    def _levels(self) -> dict[int, "Sampled"]:
        """Blurred templates by `LEVEL_LOG_BLUR` steps of the logarithm of their blur."""
        return {}

    def at(self, d: Array, log_blur: float) -> tuple[Array, Array, Array, Array]:
        """Return values and derivatives of the template as a camera that blurs would see it.

        Between two blurs of the steps they are linear in the logarithm of the blur.

        Parameters
        ----------
        d : ndarray, (n, 2)
            Pixels from the centre.
        log_blur : float
            Logarithm of the standard deviation of the Gaussian that blurs, pixels.

        Returns
        -------
        value, du, dv, ds : ndarray, (n,)
            The value, and its derivatives by both coordinates, 1/px, and by `log_blur`.
        """
        low = int(np.floor(log_blur / LEVEL_LOG_BLUR))
        for level in (low, low + 1):
            if level not in self._levels:
                self._levels[level] = self.blurred(float(np.exp(level * LEVEL_LOG_BLUR)))
        share = log_blur / LEVEL_LOG_BLUR - low
        a, b = (self._levels[level].at(d) for level in (low, low + 1))
        value, du, dv = ((1.0 - share) * x + share * y for x, y in zip(a, b, strict=True))
        return value, du, dv, (b[0] - a[0]) / LEVEL_LOG_BLUR

    def blurred(self, sigma_px: float) -> "Sampled":
        """Return the template as a camera that blurs would see it.

        Parameters
        ----------
        sigma_px : float
            Standard deviation of the Gaussian that blurs, pixels.

        Returns
        -------
        Sampled
            Its values anywhere.
        """
        from scipy.ndimage import gaussian_filter

        return Sampled(
            np.asarray(gaussian_filter(self._sharp, sigma_px * OVERSAMPLING, mode="nearest"))
        )


@dataclass(frozen=True, eq=False)
class Sampled:
    """Values of a template between the points of its grid.

    Parameters
    ----------
    grid : ndarray
        (k, k) values, k even, centre in the middle.
    """

    grid: Array

    def value(self, d: ArrayLike) -> Array:
        """Return values.

        Parameters
        ----------
        d : array_like, (n, 2)
            Pixels from the centre.

        Returns
        -------
        ndarray, (n,)
            The values.
        """
        return self._between(self.grid, self._cells_of(d))

    @cached_property
    def _layers(self) -> tuple[Array, Array, Array]:
        dv, du = (np.gradient(self.grid, 1.0 / OVERSAMPLING, axis=k) for k in (0, 1))
        return self.grid, du, dv

    def at(self, d: ArrayLike) -> tuple[Array, Array, Array]:
        """Return values and derivatives.

        Parameters
        ----------
        d : array_like, (n, 2)
            Pixels from the centre.

        Returns
        -------
        value, du, dv : ndarray, (n,)
            The value, and its derivatives by both coordinates, 1/px.
        """
        cells = self._cells_of(d)
        value, du, dv = (self._between(layer, cells) for layer in self._layers)
        return value, du, dv

    def _cells_of(self, d: ArrayLike) -> Array:
        """Rows and columns of the grid, (2, n)."""
        half = self.grid.shape[0] / 2.0
        return np.asarray(d, dtype=np.float64)[:, ::-1].T * OVERSAMPLING + half - 0.5

    @staticmethod
    def _between(layer: Array, cells: Array) -> Array:
        """Values between the points of a grid."""
        from scipy.ndimage import map_coordinates

        return np.asarray(map_coordinates(layer, cells, order=1, mode="nearest"))


def rotated_axes(by_point: ArrayLike, azimuth_rad: float) -> Array:
    """Return what takes the axes of a signal on level ground to pixels.

    Parameters
    ----------
    by_point : array_like, (2, 3)
        Derivative of the pixel by the ground point, px/m.
    azimuth_rad : float
        Of the signal's second axis, clockwise from north.

    Returns
    -------
    ndarray, (2, 2)
        Pixels right and down by metres along the signal's axes.
    """
    c, s = np.cos(azimuth_rad), np.sin(azimuth_rad)
    return np.asarray(by_point, dtype=np.float64)[:, :2] @ np.array([[c, s], [-s, c]])
