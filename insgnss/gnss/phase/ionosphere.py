"""What the ionosphere between base and rover does to a relative position: measured on the flight
itself, and taken off.

The relative mode of the engine models no ionosphere (a broadcast model, `pos1-ionoopt`, is of its
single points alone): phases of a carrier f arrive by kappa I early, kappa = (f_1 / f)^2, and what
I, of L1, differs by between the two antennas is left in the differences.

The model. A shell at 400 km holds the vertical delay V of L1, linear around the base. A ray that
pierces it at the distances n and e, north and east of the base, where it makes the angle z' with
the shell's normal, is delayed by (V + G_n n + G_e e) / cos z'. Pierced by rays of all directions a
plane of 1500 km width is what G is measured by; what moves a height is the slope over the
kilometres between base and rover, which differs from it by L:

    dI = I_rover - I_base = D (V, G_n, G_e, L_n, L_e)^T                                        (I.1)

D being the difference of (1, n, e) / cos z' between the two ends and, of L, that of n and e over
the mean cos z'. The gradient G + L makes a rover at the distance d look higher or lower, by 1 to 2
(G + L) d. V acts by the two ends seeing a satellite at
elevations that differ by about d / R: it shortens baselines (Beutler et al. 1988), on L1 by 0.4
mm/km for each metre of V (6 10^16 electrons per m^2). V, G and L change linearly between knots
10 minutes apart.

Observations. Rounding takes the integers out of the phases y_1, y_2 of two bands at positions that
are fixed (`double_differences`). Of equal noise, their difference and their mean are independent.
With the direction u to the satellite, c constants of a system in an epoch, x the error of the
epoch's position, t an error of what the air between the heights delays, per metre of zenith, and z
one that does not depend on the heights,

    y_1 - y_2 = (kappa_2 - kappa_1) dI + h sin E + p / sin E + c                               (I.2)
    (y_1 + y_2) / 2 = -u x - (kappa_1 + kappa_2) / 2 dI + (t (h_r - h_b) + z) m(E) + c         (I.3)

(I.2) is free of geometry, but has little of dI, and h, by which the phase centres of L1 and L2 lie
farther apart in one antenna than in the other (up to centimetres; without it 23 mm of two geodetic
antennas pass for a delay that raises the rover by 46 mm, as they do for the engine's own
`pos1-ionoopt` est-stec), and p, by which patterns of unlike antennas differ low down. (I.3) has
four times as much of dI, and loses most of it with x and c, which are eliminated from the normal
equations of every epoch: the rest is what no position explains. Either gives V and G about as well,
with errors of its own; both are taken together, with weights w = sin^2 E / sigma^2 of their own
scale, cut by Huber's function. What is eliminated of an
epoch leaves a residual r, of weight w and row a among the N = A^T P A of the epoch, the redundancy

    rho = 1 - w a N^-1 a^T                                                                     (I.4)

of its variance, and sigma is the median of |r| sin E / sqrt(rho), as a normal distribution has it:
epochs of five satellites, or in which systems come and go, have sigmas of their own size.
Time-correlated residuals are counted by their sums over blocks of each satellite,

    q = sum over blocks of (sum of sqrt(w) r)^2 / sum of w r^2                                 (I.5)

is 1 for white noise; weights are divided by it, and by no less than what errors correlated over
`CORRELATED_S` make of it, which are those of an antenna that stands: the sums of (I.5) do not show
what the model follows by itself. Less than `LEAST_FLIGHT_S` is not tried. Expected beforehand are V
= 2 +- 2 m, G = 0 +- 1.5 mm/km and L = 0 +- 1 mm/km (means of the flight), changes in 10 minutes of
0.15 m and 0.5 mm/km, h = 0 +- 20 mm, t = 0 +- 2 mm over 100 m, z = p = 0 +- 1 mm.

Taking it off. What is early by the mean kappa of the bands that the engine takes of a satellite
moves a position (`engine_weighting`, E.2) by

    displacement -(A^T P A)^-1 A^T P kappa dI                                                  (I.6)

which is taken off fixed positions. Their covariance grows by that of V, G and L, and by a tenth of
the correction for the shell and the plane. With d the row of (I.6) that G and L move the height by,

    gain = 1 - (d C d^T) / (d C_0 d^T)                                                         (I.7)

is the share of its variance C_0 before the flight that the observations take away, C being left;
where it is less than `LEAST_SHARE_REMOVED`, G and L do not move heights, which have all of C_0. A
float position takes the delay up in its ambiguities and stays as it is, as does one farther from
the base than `FAR_M`, where the delay may pass for a cycle.

Ten simulated flights of 21 minutes (2.5 to 4 km; noise of 1.5 mm, reflections of 1.2 mm) with each
of four airs: mean errors rms of horizontal length and height, mm, without the correction, with it,
and with the one before, which knew no L, z and p and reflections of 30 s at most:

                                             without        with           before
    plane of 1.5 mm/km, reflections of  20 s  4.3   4.6     0.7   1.6      0.7   1.6
                                       200 s  4.6   4.9     1.3   2.2      1.7   3.7
    over the kilometres alone,          20 s  3.8   7.3     0.5   6.4      0.8   7.0
                                       200 s  4.0   7.5     1.2   5.5      1.7   6.8

The height's errors are 0.3 to 1.2 of its standard deviations, and were 0.5 to 2.5. A simulation by
others, which has the gradient over the kilometres alone: 3 km and 8 minutes, horizontally 6.1 to
1.8 mm, height 10.5 to 10.8 +- 6.6 mm; 1.4 km and 6 minutes, 2.8 to 1.3 mm, height 1.3 to 1.5 mm
(gain 0.15, so that only V moves it). What remains is that antennas of unlike patterns have more
than h and p that depends on the elevation: a millimetre of it is one of some millimetres of height.

Beutler, Bauersima, Gurtner, Rothacher, Schildknecht, Geiger (1988): Atmospheric refraction and
other important biases in GPS carrier phase observations. IS-GPS-200 20.3.3.5.2.5 (Klobuchar) for
the shell. RTKLIB manual, E.7, for the differences.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...records import Array, GnssFixes
from ...records.variances import MAD_TO_SIGMA
from ..options import EngineOptions
from ..rinex.navigation_message import Navigation
from ..rinex.observation_record import Observations
from ..satellites.engine_weighting import displacement
from ..satellites.frequencies import ENGINE_BANDS, kappa, rows_of_systems
from ..satellites.satellite_geometry import Sky, common_bands
from ..satellites.visible_satellites import directions
from .double_differences import DoubleDifferences, double_differences, measurable
from .ionosphere_shell import shell_design
from .troposphere import Atmosphere, mapping

Index = NDArray[np.int64]

KNOT_S = 600.0  # between knots of V, G and L, which change linearly: 0.15 m a knot is usual
VERTICAL_M = (2.0, 2.0)  # V expected, and its standard deviation
# standard deviations: G and L m/m, h m, t m/m, z m, p m
GRADIENT, LOCAL_GRADIENT, OFFSET_M, AIR_SLOPE, ZENITH_M, PATTERN_M = (
    1.5e-6,
    1e-6,
    2e-2,
    2e-5,
    1e-3,
    1e-3,
)
NUISANCES = np.array([OFFSET_M, AIR_SLOPE, ZENITH_M, PATTERN_M])
# by which the columns of h, t, z and p are of one size (m, m/m, m, m): some millimetres each
NUISANCE_UNITS = (1e-3, 1e-5, 1e-3, 1e-3)
LAYER_CHANGE = np.array([0.15, 5e-7, 5e-7, 5e-7, 5e-7])  # of V, G and L in `KNOT_S`
# by which columns of V, G and L are of one size
LAYER_UNITS = np.array([1.0, 1e-6, 1e-6, 1e-6, 1e-6])
LAYER_VALUES = LAYER_UNITS.size
LEAST_EPOCHS, LEAST_FLIGHT_S = 60, 300.0  # of a flight: fewer show less than is expected beforehand
# of sums of residuals (I.5), and time scale of the reflections at an antenna that stands
BLOCK_S, CORRELATED_S = 300.0, 200.0
HUBER = 2.0  # sigmas from which on a residual is weighed down: 5 % of normal ones
WEIGHTED_SOLUTIONS = 4  # of solving with weights (chosen)
LEAST_SIGMA_M = 1e-6  # of residuals (m): above zero, so that exact observations have a weight
LEAST_RESIDUAL_M = 1e-9  # that a weight divides by (m): above zero, far below any phase noise
RANK_TOLERANCE = (
    1e-9  # of singular values over the largest, below which a parameter is undetermined
)
NORMAL_RIDGE = 1e-9  # added to normal equations of order 1, whose groups may lack a system
LEAST_REDUNDANCY = 1e-3  # of a row (I.4): below it its residual is rounding and tells nothing
SHAPE_SHARE = 0.1  # of the correction, one standard deviation: what shell and plane leave (chosen)
# of a height's variance by G and L that the flight has to take away before they move it (I.7)
LEAST_SHARE_REMOVED = 0.25
# values of pos1-ionoopt by which the engine's relative mode knows of an ionosphere
MODELLED = {"3", "dual-freq", "4", "est-stec"}


@dataclass(frozen=True, eq=False)
class KnottedIonosphere:
    """Ionosphere between base and rover, linear between knots.

    Parameters
    ----------
    time : ndarray, shape (k,)
        Of the knots, s.
    value : ndarray, shape (k, 5)
        V m, G_n, G_e, L_n, L_e m/m.
    cov : ndarray, shape (5 k, 5 k)
        Of the values, knot by knot.
    offset_m, air : tuple of float
        h and t, each with its standard deviation.
    epochs : int
        Number of epochs of the double differences.
    sigma_m : tuple of float
        Of (I.2) and (I.3) at the zenith, m.
    correlation : tuple of float
        q of (I.5) of them, the factor for time-correlated errors.
    """

    time: Array
    value: Array
    cov: Array
    offset_m: tuple[float, float]
    air: tuple[float, float]
    epochs: int
    sigma_m: tuple[float, float]
    correlation: tuple[float, float]

    def interpolate(self, time: ArrayLike) -> tuple[Array, Array]:
        """Return value (n, 5) and covariance (n, 5, 5) at times (n,), s."""
        H = hats(self.time, np.asarray(time, dtype=np.float64))
        k, q = self.value.shape
        half = np.tensordot(H, self.cov.reshape(k, q, k, q), axes=(1, 0))
        return H @ self.value, np.einsum("niaj,na->nij", half, H)


@dataclass(frozen=True, eq=False)
class IonosphereCorrection:
    """Correction to be added to n positions, north, east, down.

    Parameters
    ----------
    correction_ned : ndarray, shape (n, 3)
        m, zero where the fix is not fixed, or far.
    cov_ned : ndarray, shape (n, 3, 3)
        m^2.
    ionosphere : KnottedIonosphere
        The estimate that it is computed from.
    gain : float
        (I.7), the share of the variance of a height that the estimate takes away; below
        `LEAST_SHARE_REMOVED` gradients do not move heights.
    """

    correction_ned: Array
    cov_ned: Array
    ionosphere: KnottedIonosphere
    gain: float


def ionosphere_correction(
    fixes: GnssFixes,
    rover: Observations,
    base: Observations,
    navigation: Navigation,
    base_position_m: ArrayLike,
    satellites: Sky,
    air: Atmosphere | None = None,
    frequencies: int = 2,
) -> IonosphereCorrection | None:
    """Correct fixed positions for the ionosphere between base and rover.

    Parameters
    ----------
    fixes : GnssFixes
        Positions of the rover.
    rover, base : Observations
        Observations of both.
    navigation : Navigation
        Broadcast ephemerides.
    base_position_m : array_like, shape (3,)
        m ECEF.
    satellites : Sky
        Satellites at the epochs of `fixes` (`satellite_geometry.common_sky`).
    air : Atmosphere, optional
        At the base, None for the standard one.
    frequencies : int
        Number of frequencies of the engine.

    Returns
    -------
    IonosphereCorrection or None
        None where fewer than `LEAST_EPOCHS`, or less than `LEAST_FLIGHT_S`, measure it.
    """
    base_ecef = np.asarray(base_position_m, dtype=np.float64)
    design = shell_design(fixes, satellites, base_ecef)
    ionosphere = fit(
        double_differences(fixes, rover, base, navigation, base_ecef, satellites, design, air)
    )
    if ionosphere is None:
        return None
    mean_delay = mean_kappa(rover, base, satellites, frequencies)[:, None] * design
    displacement_per_unit = np.stack(
        [displacement(satellites, mean_delay[:, j], fixes.time.size) for j in range(LAYER_VALUES)],
        axis=2,
    )
    corrected = measurable(fixes, base_ecef) & np.isfinite(displacement_per_unit).all(axis=(1, 2))
    displacement_per_unit = np.where(corrected[:, None, None], displacement_per_unit, 0.0)
    correction, cov, gain = moved_by(displacement_per_unit, ionosphere, fixes.time, corrected)
    spread = cov + SHAPE_SHARE**2 * correction[:, :, None] * correction[:, None, :]
    return IonosphereCorrection(correction, spread, ionosphere, gain)


def moved_by(
    each: Array, ionosphere: KnottedIonosphere, time: Array, corrected: NDArray[np.bool_]
) -> tuple[Array, Array, float]:
    """Return what an ionosphere moves positions by, no farther down or up than the flight shows.

    Parameters
    ----------
    each : ndarray, shape (n, 3, 5)
        North, east, down, m, per unit of V, G and L.
    ionosphere : KnottedIonosphere
        The estimate.
    time : ndarray, shape (n,)
        s.
    corrected : ndarray of bool, shape (n,)
        Which positions are moved at all.

    Returns
    -------
    correction : ndarray, shape (n, 3)
        m, with (I.7) for the heights.
    cov : ndarray, shape (n, 3, 3)
        m^2.
    gain : float
        (I.7) of the median epoch.
    """
    value, cov = ionosphere.interpolate(time)
    gradient = np.arange(LAYER_VALUES) > 0
    prior_variance = np.array([GRADIENT, GRADIENT, LOCAL_GRADIENT, LOCAL_GRADIENT]) ** 2
    down_per_unit = each[:, 2][:, gradient]
    posterior_variance = np.einsum("na,nab,nb->n", down_per_unit, cov[:, 1:, 1:], down_per_unit)
    gain = 1.0 - float(
        np.median(
            (posterior_variance / np.maximum(down_per_unit**2 @ prior_variance, 1e-30))[corrected]
        )
    )
    if gain >= LEAST_SHARE_REMOVED:
        return np.einsum("nij,nj->ni", each, value), each @ cov @ each.transpose(0, 2, 1), gain
    each = each.copy()
    each[:, 2, gradient] = 0.0
    spread = each @ cov @ each.transpose(0, 2, 1)
    spread[:, 2, 2] += down_per_unit**2 @ prior_variance
    return np.einsum("nij,nj->ni", each, value), spread, gain


def engine_models_it(options: EngineOptions) -> bool:
    """Return whether the engine's options model the ionosphere, or combine the bands against it."""
    return str(options.rtklib_options.get("pos1-ionoopt", "")) in MODELLED


def fit(d: DoubleDifferences) -> KnottedIonosphere | None:
    """Estimate V, G, L, h, t, z and p from both kinds of observations.

    None where epochs are fewer than `LEAST_EPOCHS` or within less than `LEAST_FLIGHT_S`.
    """
    epochs = np.unique(d.time)
    if epochs.size < LEAST_EPOCHS or np.ptp(epochs) < LEAST_FLIGHT_S:
        return None
    knots = np.linspace(epochs[0], epochs[-1], 1 + int(np.ceil(np.ptp(epochs) / KNOT_S)))
    units = np.concatenate([np.tile(LAYER_UNITS, knots.size), NUISANCE_UNITS])
    expected, information = expectation(knots)
    least = max(CORRELATED_S / float(np.median(np.diff(epochs))), 1.0)
    N = information * units[:, None] * units
    b = units * (information @ expected)
    kinds = _observations_of_kinds(d, knots, units)
    sigma, correlation = [], []
    for kind in kinds:
        X, y, weight, sd, q = kind.weighted(d, least)
        N = N + X.T @ (weight[:, None] * X)
        b = b + X.T @ (weight * y)
        sigma.append(sd)
        correlation.append(q)
    scaled_cov = np.linalg.inv(N)
    x = units * (scaled_cov @ b)
    cov = scaled_cov * units[:, None] * units
    k = LAYER_VALUES * knots.size
    (h, t), (sd_h, sd_t) = x[k : k + 2].tolist(), np.sqrt(np.diag(cov)[k : k + 2])
    return KnottedIonosphere(
        knots,
        x[:k].reshape(-1, LAYER_VALUES),
        cov[:k, :k],
        (h, float(sd_h)),
        (t, float(sd_t)),
        epochs.size,
        (sigma[0], sigma[1]),
        (correlation[0], correlation[1]),
    )


def hats(knots: Array, time: Array) -> Array:
    """Return the weights (n, k) of knots for values linear between them and constant beyond."""
    return np.column_stack([np.interp(time, knots, row) for row in np.eye(knots.size)])


def expectation(knots: Array) -> tuple[Array, Array]:
    """Return the expected V, G and L at k knots, h, t, z and p (5 k + 4,), and their information.

    The information is of the knots' mean, and of their changes.
    """
    k = knots.size
    step = np.diff(np.eye(k), axis=0)
    information = np.diag(np.concatenate([np.zeros(LAYER_VALUES * k), NUISANCES**-2]))
    for j, sd in enumerate((VERTICAL_M[1], GRADIENT, GRADIENT, LOCAL_GRADIENT, LOCAL_GRADIENT)):
        rows = np.arange(j, LAYER_VALUES * k, LAYER_VALUES)
        change_variance = LAYER_CHANGE[j] ** 2 * np.diff(knots) / KNOT_S
        information[np.ix_(rows, rows)] = (k * sd) ** -2.0 + step.T @ (
            step / change_variance[:, None]
        )
    mean = np.array([VERTICAL_M[0], *np.zeros(LAYER_VALUES - 1)])
    return np.concatenate([np.tile(mean, k), np.zeros(NUISANCES.size)]), information


@dataclass(frozen=True, eq=False)
class _Observations:
    """Observations (m,) m of one kind: y = X (5 k + 4 columns, of size one) + A times unknowns of
    each group (m,) + noise.
    """

    X: Array
    y: Array
    A: Array
    group: Index

    def weighted(
        self, d: DoubleDifferences, least: float
    ) -> tuple[Array, Array, Array, float, float]:
        """Return X and y without the unknowns of groups, weights (m,), 1/m^2, sigma, m, and q.

        sigma is that at the zenith, q is `least` at least.
        """
        sine = np.sin(d.elevation)
        weight = sine**2
        Xy = np.column_stack([self.X, self.y])
        for _ in range(WEIGHTED_SOLUTIONS):
            reduced, redundancy = _without_nuisances(Xy, self.A, self.group, weight)
            X, y, root = reduced[:, :-1], reduced[:, -1], np.sqrt(weight)
            x, _, rank, _ = np.linalg.lstsq(root[:, None] * X, root * y, rcond=RANK_TOLERANCE)
            residual = y - X @ x
            redundant = redundancy > LEAST_REDUNDANCY
            size = np.abs(residual) * sine
            limit = HUBER * _robust_sigma(size[redundant])
            weight = sine**2 * np.minimum(1.0, limit / np.maximum(size, LEAST_RESIDUAL_M))
        free = float(redundancy.sum())
        sigma = (
            _robust_sigma(size[redundant] / np.sqrt(redundancy[redundant]))
            * (free / max(free - rank, 1.0)) ** 0.5
        )
        q = max(_block_correlation(np.sqrt(weight) * residual, d), least)
        return X, y, weight / (q * sigma**2), float(sigma), q


def _robust_sigma(size: Array) -> float:
    """Return the standard deviation, m, of normal values of absolute values `size` (m,), m."""
    return max(MAD_TO_SIGMA * float(np.median(size)), LEAST_SIGMA_M) if size.size else LEAST_SIGMA_M


def _observations_of_kinds(
    d: DoubleDifferences, knots: Array, units: Array
) -> tuple[_Observations, _Observations]:
    """Return the observations of the difference (I.2) and the mean (I.3) of both bands."""
    sine = np.sin(d.elevation)
    H = (hats(knots, d.time)[:, :, None] * d.design[:, None, :]).reshape(d.time.size, -1)
    none = np.zeros(d.time.size)
    clocks = (d.system[:, None] == np.unique(d.system)).astype(np.float64)
    slant = mapping(d.elevation)
    between = (d.kappa[:, 1] - d.kappa[:, 0])[:, None] * H
    difference = np.column_stack([between, sine, none, none, 1.0 / sine]) * units
    early = -d.kappa.mean(axis=1)[:, None] * H
    mean = np.column_stack([early, none, d.rise * slant, slant, none]) * units
    sight = -directions(d.azimuth, d.elevation)
    return (
        _Observations(difference, d.parts[:, 0] - d.parts[:, 1], clocks, d.epoch),
        _Observations(mean, d.parts.mean(axis=1), np.column_stack([sight, clocks]), d.epoch),
    )


def _without_nuisances(values: Array, A: Array, group: Index, weight: Array) -> tuple[Array, Array]:
    """Return values (m, c) less their weighted fit of A (m, p) in each group, redundancies (m,).

    Both are those of (I.4).
    """
    n = int(group.max()) + 1
    p = A.shape[1]
    WA = A * weight[:, None]

    def sums(columns: Array) -> Array:
        of_rows = ([np.bincount(group, row * column, n) for column in columns.T] for row in WA.T)
        return np.stack([np.stack(row, axis=1) for row in of_rows], axis=1)

    N, b = sums(A), sums(values)
    inverse = np.linalg.inv(N + NORMAL_RIDGE * np.eye(p))
    redundancy = 1.0 - np.einsum("mi,mij,mj->m", WA, inverse[group], A)
    return values - np.einsum("mi,mic->mc", A, (inverse @ b)[group]), redundancy


def _block_correlation(weighted: Array, d: DoubleDifferences) -> float:
    """Return q (I.5) of residuals (m,) times the roots of their weights."""
    block = ((d.time - d.time.min()) / BLOCK_S).astype(np.int64)
    block = np.unique(d.satellite * (int(block.max()) + 1) + block, return_inverse=True)[1]
    return float((np.bincount(block, weighted) ** 2).sum() / (weighted**2).sum())


def mean_kappa(
    rover: Observations, base: Observations, satellites: Sky, frequencies: int = 2
) -> Array:
    """Return the mean kappa (m,) of the bands that the engine takes of each satellite.

    These are the ones in which rover and base have a phase.
    """
    has_band = common_bands(rover, base, frequencies)[satellites.row]
    total = np.zeros(satellites.row.size)
    for letter, rows in rows_of_systems(rover.satellite[satellites.row]).items():
        kappas = [kappa(letter, bands[0]) for bands in ENGINE_BANDS[letter][:frequencies]]
        total[rows] = has_band[rows] @ np.array(kappas)
    return np.asarray(total / has_band.sum(axis=1))
