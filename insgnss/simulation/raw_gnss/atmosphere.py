"""What the air does to a signal of a satellite.

The delay of the troposphere by a ray through its layers, and of the ionosphere by a shell.

Troposphere. Refractivity N of dry air and vapour (Rueger 2002, "best average") of temperature T,
pressure P and vapour pressure e,

    N = 77.6890 (P - e) / T + 71.2952 e / T + 375463 e / T^2                                   (A.1)

with T falling by 6.5 K/km up to 11 km and constant above, P in hydrostatic balance with it, and e
falling by a factor of e every 2 km. A ray that arrives at elevation E at the height h is straight;
with r from the Earth's centre, r0 = R + h,

    delay = 1e-6 int N ds,   ds = r dr / sqrt(r^2 - r0^2 cos^2 E)                              (A.2)

so that no mapping function, no zenith delay and no law of either for the height is supposed: the
model has nothing of Saastamoinen's, Niell's, Askne and Nordius' or Black and Eisner's in it.
Bending adds decimetres at 5 degrees, the same to receivers near to each other.

Ionosphere. A shell at 350 km holds the vertical delay V. A ray of elevation E and azimuth A from
latitude phi, longitude lambda and height h pierces it at the zenith angle z', the angle psi seen
from the Earth's centre away from the receiver (IS-GPS-200 20.3.3.5.2.5, unabridged), at the place
x, north and east of a site in its tangent plane:

    sin z' = (R + h) cos E / (R + H),   psi = pi / 2 - E - z'
    sin phi' = sin phi cos psi + cos phi sin psi cos A,
    lambda' = lambda + asin(sin psi sin A / cos phi')                                          (A.3)

    V(x, t) = V0 + V' t + G x + a sin(2 pi (k x / length - t / period) + phase)                (A.4)

is that of L1; the code on a carrier f is later by V / cos z' (f1 / f)^2, its phase earlier by as
much.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...base.units import STANDARD_GRAVITY as GRAVITY
from ...io.options.kinds import check
from ...io.options.schema import option
from ...records import Array

MEAN_EARTH_RADIUS_M = 6.371e6  # mean radius of the Earth, R of (A.2) and (A.3)
LAPSE, TROPOPAUSE_M = 6.5e-3, 1.1e4  # K/m up to this height: the standard atmosphere
# J/(kg K), stated here too: what is simulated borrows nothing from what corrects it
GAS_CONSTANT_AIR = 287.053
VAPOUR_SCALE_M = 2000.0  # over which vapour pressure falls by a factor of e
LAYERS = 0.0, 0.15, 0.4, 1.0  # of the way from the antenna to the tropopause, whose bend is an edge
HIGH_LAYERS_M = (2e4, 4e4, 8e4)  # tops of the layers above the tropopause (chosen)
LAYER_NODES = 12  # of a layer
SHELL_HEIGHT_M = 3.5e5  # of the ionosphere (IS-GPS-200: 350 km)
WAVE_LENGTH_M, WAVE_PERIOD_S = 1.5e5, 900.0  # of a travelling disturbance
LOWEST_TABLED_DEG = 2.0  # lowest elevation of (A.2)


@dataclass(frozen=True)
class Weather:
    """Air at the base's antenna: pressure, temperature and relative humidity.

    The pressure is that there, not reduced to sea level; the humidity is 0 to 1.
    """

    pressure_hpa: float = option(
        957.0, "pressure, not reduced to sea level", unit="hPa", low=300.0, high=1100.0
    )
    temperature_c: float = option(18.0, "temperature", unit="C", low=-60.0, high=60.0)
    humidity: float = option(0.6, "relative humidity", low=0.0, high=1.0)

    def __post_init__(self) -> None:
        check(self, "weather")

    @property
    def vapour_pressure_hpa(self) -> float:
        """Partial pressure of water vapour, by Tetens' formula."""
        return (
            self.humidity
            * 6.1078
            * float(np.exp(17.27 * self.temperature_c / (self.temperature_c + 237.3)))
        )


@dataclass(frozen=True)
class Troposphere:
    """The air over a place of `height` m where the weather is known."""

    weather: Weather
    height: float

    def refractivity(self, height: ArrayLike) -> Array:
        """N (A.1) at heights, m, of any shape."""
        height = np.asarray(height, dtype=np.float64)
        ground = self.weather.temperature_c + 273.15
        low = np.minimum(height, TROPOPAUSE_M)
        T = ground - LAPSE * (low - self.height)
        P = (
            self.weather.pressure_hpa
            * (T / ground) ** (GRAVITY / (GAS_CONSTANT_AIR * LAPSE))
            * np.exp(-GRAVITY * (height - low) / (GAS_CONSTANT_AIR * T))
        )
        e = self.weather.vapour_pressure_hpa * np.exp(-(height - self.height) / VAPOUR_SCALE_M)
        return np.asarray(77.6890 * (P - e) / T + 71.2952 * e / T + 375463.0 * e / T**2)

    def slant_delay(self, height: ArrayLike, elevation: ArrayLike) -> Array:
        """Return the delay, m, at heights, m, and elevations, rad, that broadcast (A.2).

        Heights are below the tropopause, elevations above 2 degrees.
        """
        height, elevation = np.broadcast_arrays(
            np.asarray(height, dtype=np.float64), np.asarray(elevation, dtype=np.float64)
        )
        x, w = np.polynomial.legendre.leggauss(LAYER_NODES)
        start, low = MEAN_EARTH_RADIUS_M + height, TROPOPAUSE_M - height
        edges = [*(share * low for share in LAYERS), *(top - height for top in HIGH_LAYERS_M)]
        total = np.zeros(height.shape)
        for bottom, top in pairwise(edges):
            for node, weight in zip(x, w, strict=True):
                above = 0.5 * (top - bottom) * (node + 1.0) + bottom
                path = (start + above) / np.sqrt(
                    above * (2.0 * start + above) + (start * np.sin(elevation)) ** 2
                )
                total += 0.5 * (top - bottom) * weight * self.refractivity(height + above) * path
        return 1e-6 * total

    def table(self, lowest: float, highest: float, lowest_elevation: float) -> Any:
        """Spline over height, m, and elevation, rad, of the delay times the sine of the elevation.

        Called with `grid=False`.
        """
        from scipy.interpolate import RectBivariateSpline

        heights = np.linspace(lowest - 1.0, highest + 1.0, 8)
        elevations = np.linspace(
            max(lowest_elevation, np.radians(LOWEST_TABLED_DEG)), 0.5 * np.pi, 400
        )
        delay = self.slant_delay(heights[:, None], elevations[None, :])
        return RectBivariateSpline(heights, elevations, delay * np.sin(elevations), kx=3, ky=3)


@dataclass(frozen=True)
class SimulatedIonosphere:
    """The ionospheric shell of (A.4).

    It has its site's latitude and longitude, rad, V0 m, V' m/s, G (north, east) m/m, amplitude of
    the wave m, its direction (north, east), its phase rad.
    """

    site: tuple[float, float]
    vertical_m: float
    rate_ms: float
    gradient: tuple[float, float]
    wave_m: float
    wave_direction: tuple[float, float]
    wave_phase: float

    def delay(
        self, elapsed: Array, receiver: tuple[Array, Array, Array], azimuth: Array, elevation: Array
    ) -> Array:
        """Return the ionospheric delay of the code on L1, m, (n, s), at `elapsed` (n,) s.

        `receiver` is latitude, longitude, rad, height, m, (n,).
        """
        lat, lon, height = (x[:, None] for x in receiver)
        # sine of the zenith angle at the shell
        low = (
            (MEAN_EARTH_RADIUS_M + height)
            * np.cos(elevation)
            / (MEAN_EARTH_RADIUS_M + SHELL_HEIGHT_M)
        )
        away = 0.5 * np.pi - elevation - np.arcsin(low)
        pierced_lat = np.arcsin(
            np.sin(lat) * np.cos(away) + np.cos(lat) * np.sin(away) * np.cos(azimuth)
        )
        pierced_lon = lon + np.arcsin(np.sin(away) * np.sin(azimuth) / np.cos(pierced_lat))
        north, east = self._from_site(pierced_lat, pierced_lon)
        along = north * self.wave_direction[0] + east * self.wave_direction[1]
        wave = np.sin(
            2.0 * np.pi * (along / WAVE_LENGTH_M - elapsed[:, None] / WAVE_PERIOD_S)
            + self.wave_phase
        )
        vertical = (
            self.vertical_m
            + self.rate_ms * elapsed[:, None]
            + self.gradient[0] * north
            + self.gradient[1] * east
        )
        return np.asarray((vertical + self.wave_m * wave) / np.sqrt(1.0 - low**2))

    def _from_site(self, lat: Array, lon: Array) -> tuple[Array, Array]:
        """Places on the shell, north and east of the site in its tangent plane, m."""
        phi, longitude_difference = self.site[0], lon - self.site[1]
        north = np.sin(lat) * np.cos(phi) - np.cos(lat) * np.sin(phi) * np.cos(longitude_difference)
        return (MEAN_EARTH_RADIUS_M + SHELL_HEIGHT_M) * north, (
            MEAN_EARTH_RADIUS_M + SHELL_HEIGHT_M
        ) * np.cos(lat) * np.sin(longitude_difference)
