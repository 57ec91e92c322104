"""What the delay of the air between base and rover does to a relative position, and its correction
after the fact.

The relative mode of the engine models the hydrostatic delay of a standard atmosphere at both
antennas and nothing of the wet one: what the air between the heights h_b of the base and h_r of the
rover delays beyond that is left in the differences. In zenith it is

    D = -(W + H) + H_0,   W = 1e-6 int (k2' e / T + k3 e / T^2) dh,
    H = 2.2768e-3 (P_b - P_r) / f                                                              (T.1)

from h_b to h_r, f = 1 - 2.66e-3 cos(2 lat) - 2.8e-7 h_b, H_0 what the engine takes for H (RTKLIB:
the same with the pressure 1013.25 (1 - 2.2557e-5 h)^5.2568 hPa). With T = T_b - beta (h - h_b), the
pressure of a hydrostatic column of that lapse and the vapour e = e_b (P / P_b)^(lambda + 1), x =
T_r / T_b, nu = g / (R beta), mu = (lambda + 1) nu:

    P_r = P_b x^nu                                                                             (T.2)
    W = 1e-6 (e_b / beta) (k2' (1 - x^mu) / mu + (k3 / T_b) (1 - x^(mu - 1)) / (mu - 1))       (T.3)

Only the layer between the two antennas counts, so that what a thermometer and a hygrometer at the
base say is nearly all there is to know. A satellite at elevation E sees m(E) D, m = 1.001 /
sqrt(0.002001 + sin^2 E).

Of m(E), the delay per metre of D, the engine's estimator (`engine_weighting`, E.2) makes a
displacement s, and

    displacement s D                                                                           (T.4)

is taken off. The part of s down is -2 to -5 (a delay that grows towards the horizon looks like
height), D is negative for a rover above the base, so that it comes out too low, by 0.1 to 0.3 mm
per metre. Satellites are those that rover and base both observe above the mask. The uncertainty is
that of the weather given, propagated through (T.1), and a tenth of the correction for s and the
layer's profile, in which the weight of vapour (2 % too much) and its own mapping (1 % too little)
are left out: over 100 m 3 mm of 14 with the weather measured, 7 mm with the standard atmosphere for
one that nobody knows.

Wet refractivity: Thayer (1974) constants as in Bevis et al. (1994), k2' = 22.1 K/hPa, k3 = 3.739e5
K^2/hPa. Vapour and its fall with height: Askne and Nordius (1987), lambda = 2.8 (mid-latitudes,
UNB3). Hydrostatic delay: Saastamoinen (1972), Davis et al. (1985). Mapping: Black and Eisner
(1984), as in RTCA DO-229, 0.5 % above 10 degrees.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from ...base.errors import DataError, InputError
from ...base.units import STANDARD_GRAVITY
from ...geodesy.frames import ecef_to_geodetic
from ...io.options.schema import declared_options
from ...records import Array, GnssFixes
from ...records.qualities import Quality
from ..ppk_options import Air
from ..satellites.engine_weighting import displacement
from ..satellites.satellite_geometry import Sky

LAPSE = 6.5e-3  # K/m
DRY_AIR = 287.053  # gas constant of dry air, J/(kg K)
NU = STANDARD_GRAVITY / (DRY_AIR * LAPSE)
VAPOUR_LAMBDA = 2.8  # fall of vapour with height, mid-latitudes (Askne and Nordius, UNB3)
MU_VAPOUR = (VAPOUR_LAMBDA + 1.0) * NU  # mu of (T.3)
K2, K3 = 22.1, 3.739e5  # K/hPa, K^2/hPa
CELSIUS_ZERO = 273.15  # K
# of the correction, one standard deviation: what (T.4) and the profile (T.3) leave
SHAPE_SHARE = 0.1
LIMITS = {name: (item.option.low, item.option.high) for name, item in declared_options(Air).items()}
CORRECTED = (1, 2)  # of RTKLIB's qualities: fixed and float, the two of its relative mode of phases
# name, least and largest of the stated standard deviations (hPa, K, 1): larger ones are no sigmas
SIGMA_LIMITS = (
    ("sd_pressure_hpa", 0.0, 100.0),
    ("sd_temperature_c", 0.0, 30.0),
    ("sd_humidity", 0.0, 0.5),
)
TOP_M = 4.4e4  # height (m) above which the standard atmosphere's air adds no delay


@dataclass(frozen=True)
class Atmosphere:
    """Air at the base, with standard deviations.

    Parameters
    ----------
    pressure_hpa : float
        At the antenna, not reduced to sea level.
    temperature_c : float
        Degrees Celsius.
    humidity : float
        Relative, 0 to 1.
    sd_pressure_hpa, sd_temperature_c, sd_humidity : float
        Their standard deviations.

    Raises
    ------
    InputError
        For a value outside of its limits.
    """

    pressure_hpa: float
    temperature_c: float
    humidity: float
    sd_pressure_hpa: float = 2.0
    sd_temperature_c: float = 3.0
    sd_humidity: float = 0.1

    def __post_init__(self) -> None:
        limits = ((name, *ends) for name, ends in LIMITS.items())
        for name, low, high in (*limits, *SIGMA_LIMITS):
            value = getattr(self, name)
            if not low <= value <= high:
                raise InputError(
                    f"atmosphere.{name}: {value:g} is outside {low:g} to {high:g}; check its unit"
                )

    @property
    def vapour_pressure_hpa(self) -> float:
        """Return the partial pressure of water vapour, hPa.

        It is Magnus' formula over water (WMO No. 8, annex 4.B).
        """
        return (
            self.humidity
            * 6.112
            * float(np.exp(17.62 * self.temperature_c / (243.12 + self.temperature_c)))
        )


def standard_atmosphere(
    height: float,
    temperature_c: float | None = None,
    humidity: float | None = None,
    pressure_hpa: float | None = None,
) -> Atmosphere:
    """Return the standard atmosphere at `height`, m above the ellipsoid; what is given replaces it.

    It has 1013.25 hPa and 15 C at sea level, humidity 0.7.
    Its 12 hPa of vapour are the yearly mean of UNB3 at latitude 45 (11.7 hPa).
    Its standard deviations are those of the weather on which flights take place: 10 hPa, 10 K, 0.2;
    of given values the ones of `Atmosphere`.
    """
    ratio = 1.0 - LAPSE * height / (15.0 + CELSIUS_ZERO)
    return Atmosphere(
        1013.25 * ratio**NU if pressure_hpa is None else pressure_hpa,
        15.0 - LAPSE * height if temperature_c is None else temperature_c,
        0.7 if humidity is None else humidity,
        10.0 if pressure_hpa is None else Atmosphere.sd_pressure_hpa,
        10.0 if temperature_c is None else Atmosphere.sd_temperature_c,
        0.2 if humidity is None else Atmosphere.sd_humidity,
    )


def wet_layer(atmosphere: Atmosphere, rise: ArrayLike) -> Array:
    """Return the wet zenith delay W, m, of the layer from the base to `rise`, m, above it (T.3).

    It is negative below the base.
    """
    kelvin = atmosphere.temperature_c + CELSIUS_ZERO
    x = 1.0 - LAPSE * np.asarray(rise, dtype=np.float64) / kelvin
    terms = K2 * (1.0 - x**MU_VAPOUR) / MU_VAPOUR + K3 / kelvin * (1.0 - x ** (MU_VAPOUR - 1.0)) / (
        MU_VAPOUR - 1.0
    )
    return np.asarray(1e-6 * atmosphere.vapour_pressure_hpa / LAPSE * terms)


def hydrostatic_layer(
    atmosphere: Atmosphere, rise: ArrayLike, lat: ArrayLike, height: float
) -> Array:
    """Return the hydrostatic zenith delay H, m, of the layer from the base to `rise` above it.

    Parameters
    ----------
    atmosphere : Atmosphere
        Air at the base.
    rise : array_like
        Height above the base, m.
    lat : array_like
        Latitude, rad.
    height : float
        Height of the base, m.
    """
    kelvin = atmosphere.temperature_c + CELSIUS_ZERO
    x = 1.0 - LAPSE * np.asarray(rise, dtype=np.float64) / kelvin
    return np.asarray(2.2768e-3 * atmosphere.pressure_hpa * (1.0 - x**NU) / _site(lat, height))


def _site(lat: ArrayLike, height: float) -> Array:
    """Return the factor of gravity at a latitude, rad, and height, m (Saastamoinen)."""
    return np.asarray(1.0 - 2.66e-3 * np.cos(2.0 * np.asarray(lat)) - 2.8e-7 * height)


def mapping(elevation: ArrayLike) -> Array:
    """Return the ratio of slant to zenith delay at an elevation, rad."""
    return np.asarray(1.001 / np.sqrt(0.002001 + np.sin(elevation) ** 2))


def standard_slant_delay(lat: ArrayLike, height: ArrayLike, elevation: ArrayLike) -> Array:
    """Return the slant delay, m, hydrostatic and wet, of the standard atmosphere.

    Latitudes, rad, heights, m, and elevations, rad, are of one shape.
    """
    base = standard_atmosphere(0.0)
    height = np.asarray(height, dtype=np.float64)
    zenith = (
        hydrostatic_layer(base, TOP_M, lat, 0.0)
        + wet_layer(base, TOP_M)
        - hydrostatic_layer(base, height, lat, 0.0)
    )
    return (zenith - wet_layer(base, height)) * mapping(elevation)


def engine_layer(rise: ArrayLike, lat: float, height: float) -> Array:
    """Return the hydrostatic zenith delay H_0, m, that the engine takes for the layer.

    The layer is from the base, at latitude, rad, and height, m, to `rise`, m, above it.
    """

    def zenith(h: Array) -> Array:
        h = np.maximum(h, 0.0)
        return 2.2768e-3 * 1013.25 * (1.0 - 2.2557e-5 * h) ** 5.2568 / _site(lat, 0.0)

    return np.asarray(
        zenith(np.asarray(height)) - zenith(height + np.asarray(rise, dtype=np.float64))
    )


@dataclass(frozen=True, eq=False)
class TroposphereCorrection:
    """Correction to be added to n positions, north, east, down.

    Parameters
    ----------
    correction_ned : ndarray, shape (n, 3)
        m, zero where the fix is neither fixed nor float.
    cov_ned : ndarray, shape (n, 3, 3)
        m^2, of the correction.
    slope : ndarray, shape (n, 3)
        Displacement over zenith delay (T.4).
    zenith_m : ndarray, shape (n,)
        D of (T.1), m.
    atmosphere : Atmosphere
        Air at the base.
    height_per_metre : float
        Mean height correction over height difference, m/m; NaN where the rover stays within 1 m of
        the base's height.
    """

    correction_ned: Array
    cov_ned: Array
    slope: Array
    zenith_m: Array
    atmosphere: Atmosphere
    height_per_metre: float


def wet_delay_correction(
    fixes: GnssFixes,
    base_position_m: ArrayLike,
    satellites: Sky,
    atmosphere: Atmosphere | None = None,
) -> TroposphereCorrection:
    """Compute the correction of the engine's relative positions for the air that it leaves out.

    Parameters
    ----------
    fixes : GnssFixes
        The engine's positions.
    base_position_m : array_like, shape (3,)
        m ECEF.
    satellites : Sky
        Satellites at the epochs of `fixes` (`satellite_geometry.common_sky`).
    atmosphere : Atmosphere, optional
        Air at the base, None for the standard one.

    Raises
    ------
    DataError
        Where an epoch to be corrected has fewer satellites than unknowns.
    """
    lat, _, height = (
        float(value) for value in ecef_to_geodetic(np.asarray(base_position_m, dtype=np.float64))
    )
    atmosphere = atmosphere or standard_atmosphere(height)
    rise = fixes.height - height
    zenith = _omitted_zenith_delay(atmosphere, rise, lat, height)
    slope = displacement_per_delay(satellites, fixes.time.size)
    quality = np.ones(fixes.time.size, dtype=np.int64) if fixes.quality is None else fixes.quality
    corrected = np.isin(quality, CORRECTED)
    uncorrectable = corrected & np.isnan(slope[:, 0])
    if uncorrectable.any():
        k = int(np.argmax(uncorrectable))
        message = (
            f"{int(uncorrectable.sum())} positions, the first at {fixes.time[k]:.3f} s, have too"
            " few satellites common with the base"
        )
        raise DataError(
            f"{fixes.source or 'positions'}: {message}; check that positions and observations"
            " belong together, or switch the correction off"
        )
    variance = _weather_variance(atmosphere, rise, lat, height) + (SHAPE_SHARE * zenith) ** 2
    zenith = np.where(corrected, zenith, 0.0)
    slope = np.where(corrected[:, None], slope, 0.0)
    correction = -slope * zenith[:, None]
    variance = np.where(quality == Quality.FIXED, variance, variance + zenith**2) * corrected
    cov = slope[:, :, None] * slope[:, None, :] * variance[:, None, None]
    has_height_difference = corrected & (np.abs(rise) > 1.0)
    per_metre = (
        float(np.mean(-correction[has_height_difference, 2] / rise[has_height_difference]))
        if has_height_difference.any()
        else float("nan")
    )
    return TroposphereCorrection(correction, cov, slope, zenith, atmosphere, per_metre)


def _omitted_zenith_delay(atmosphere: Atmosphere, rise: Array, lat: float, height: float) -> Array:
    """Return D of (T.1) (n,), m: the zenith delay that the engine omits at `rise` (n,), m."""
    return (
        engine_layer(rise, lat, height)
        - hydrostatic_layer(atmosphere, rise, lat, height)
        - wet_layer(atmosphere, rise)
    )


def _weather_variance(atmosphere: Atmosphere, rise: Array, lat: float, height: float) -> Array:
    """Return the variance (n,), m^2, of D by the standard deviations of the air's quantities.

    That of a quantity is the mean square of the changes by one sigma up and one down.
    """
    zenith = _omitted_zenith_delay(atmosphere, rise, lat, height)
    variance = np.zeros(rise.shape)
    for name, (low, high) in LIMITS.items():
        value = getattr(atmosphere, name)
        sd = getattr(atmosphere, f"sd_{name}")
        ends = (
            replace(atmosphere, **{name: min(max(value + sign * sd, low), high)})
            for sign in (-1.0, 1.0)
        )
        changes = [(_omitted_zenith_delay(end, rise, lat, height) - zenith) ** 2 for end in ends]
        variance += 0.5 * (changes[0] + changes[1])
    return variance


def displacement_per_delay(satellites: Sky, epochs: int) -> Array:
    """Return the displacement (epochs, 3), north, east, down, per metre of zenith delay (T.4).

    It is NaN where satellites are too few.
    """
    return displacement(satellites, mapping(satellites.elevation), epochs)
