"""Deterministic calibration of an IMU from a recording that is stationary in many positions.

Accelerometers. When stationary in any position the specific force has the magnitude of gravity.
With raw = E f + b (the convention of `navigation.prepare.calibration`, E = I + diag(s) + N, N lower
triangular) every period i of mean reading a_i gives one equation,

    | E^-1 (a_i - b) | = g                                                                     (P.1)

in nine unknowns b, s, N: at least nine positions, well spread (Syed, Aggarwal, Goodall, Niu,
El-Sheimy 2007). With u the direction of the calibrated f and M = E^-1, d|f|/db = -u^T M and
d|f|/dE_jk = -(u^T M)_j f_k. An error of g is an error of all of E: it enters the covariance as dE =
E dg / g.

Gyroscopes. At rest they feel their bias and the Earth's rate w (a constant of the level frame, of
unknown heading, a nuisance with its prior), and between two positions they must propagate the
vertical u from the one to the next (Tedaldi, Pretto, Menegatti 2014):

    gyro_i = b + E C_i^T w                                                                     (P.2)
    u_(i+1) = R_i^T (u_i + T_i (C_i^T w) x u_i),   R_i = prod exp([E^-1 (raw - b) dt] x)       (P.3)

C_i takes the sensor's axes into the level frame of the first period; T_i is the duration of the
turn. Turns about the vertical leave u where it is and show nothing.

With v = R_i^T u, a change dp of the calibration moves it by

    dv = v x (J dp),   J dp = sum over samples, in the axes at the turn's end,
                              of -M dE (E^-1 (raw - b) dt) - M db dt                           (P.4)

The residuals of (P.3) share verticals, turn by turn, and all share the accelerometers' calibration:
their covariance is a full one.

Each group of residuals is weighted by the noise that the stationary periods show. Where its
variance factor (residuals' weighted square sum over the degrees of freedom) passes the 99 % bound
of chi-square, the group's sigmas are multiplied by its root: biases that wander from one position
to the next cost that much. Weak priors, as wide as a calibration may be, keep unobserved parameters
in place.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...base.errors import DataError, InputError
from ...base.units import STANDARD_GRAVITY
from ...geodesy.earth import EARTH_RATE, normal_gravity
from ...geodesy.rotation import rotation_from_vector, skew
from ...navigation.align.turn_on import GRAVITY_SIGMA_MS2, LEAST_SIGMA
from ...navigation.prepare.calibration import LOWER
from ...navigation.prepare.gaps import LEAST_GAP_INTERVALS, nominal_interval
from ...navigation.prepare.stationarity import StationaryPeriods, stationary_periods
from ...records import Array, ImuSamples
from ...records.states import State
from .groups import ResidualGroup, solve_groups
from .result import POSSIBLE, MultiPosition, TriadEstimate, blind_directions, places, sizes

FEWEST_POSITIONS = 9  # as many equations (P.1) as unknowns
ASTRAY = 0.02  # rad, rms: no noise of a hand-held turn makes as much
LEAST_TURN_RAD = 1e-6  # rad, of a turn's interpolation between samples
DISTINCT_RAD = np.radians(15.0)  # positions whose vertical differs by less are one
ANYWHERE_SIGMA = 0.02  # m/s^2: 9.80665 misses latitude and height
LONGEST_TURN_S = 60.0  # beyond, the gyro's drift and scale outweigh what a turn tells (chosen)
AXIS_LETTERS = "xyz"
SCALE_STATES = tuple(State("scale_factor", c) for c in AXIS_LETTERS)
ACCEL_STATES = (
    *(State("bias", c, "m/s^2") for c in AXIS_LETTERS),
    *SCALE_STATES,
    *(State("misalignment", AXIS_LETTERS[r] + AXIS_LETTERS[c], "rad") for r, c in LOWER),
)
GYRO_STATES = (
    *(State("bias", c, "rad/s") for c in AXIS_LETTERS),
    *(
        SCALE_STATES[AXIS_LETTERS.index(r)] if r == c else State("misalignment", r + c, "rad")
        for r in AXIS_LETTERS
        for c in AXIS_LETTERS
    ),
)


@dataclass(frozen=True, eq=False)
class Turn:
    """The turn from stationary period `first` to the next.

    Parameters
    ----------
    first : int
        Index of the period before the turn.
    delta : ndarray, (n, 3)
        Raw increments of angle, rad.
    dt : ndarray, (n,)
        Their intervals, s.
    sigma : float
        Standard deviation of the white noise over the turn, rad.
    """

    first: int
    delta: Array
    dt: Array
    sigma: float


def calibrate_multi_position(
    imu: ImuSamples, latitude: float | None = None, height: float = 0.0
) -> MultiPosition:
    """Calibrate both triads from a recording that is stationary in many positions.

    Parameters
    ----------
    imu : ImuSamples
        The recording.
    latitude : float, optional
        Geodetic latitude of the site, rad; without it, gravity is 9.80665 m/s^2 with 0.02 m/s^2.
    height : float
        Height of the site above the ellipsoid, m.

    Returns
    -------
    MultiPosition
        Calibration with its standard errors.

    Raises
    ------
    DataError
        For fewer than `FEWEST_POSITIONS` positions, and for an outcome beyond what a calibration
        may be.
    """
    periods = stationary_periods(imu)
    positions = distinct_positions(periods)
    if positions < FEWEST_POSITIONS:
        raise DataError(
            f"{imu.source or 'IMU'}: {positions} positions found in {len(periods)} stationary"
            f" periods, {FEWEST_POSITIONS} needed; rest the sensor for at least 5 s in each"
            " position, with each face and edge up and down"
        )
    gravity, sigma = local_gravity(latitude, height)
    accel = calibrate_accelerometers(periods, gravity, sigma)
    turns = find_turns(imu, periods)
    try:
        gyro = calibrate_gyroscopes(periods, turns, accel, latitude)
    except DataError as error:
        raise DataError(f"{imu.source or 'IMU'}: {error}") from None
    result = MultiPosition(
        accel, gyro, periods, positions, len(turns), gravity, sigma, imu.source or "IMU"
    )
    try:
        _ = result.calibration
    except InputError as error:
        raise DataError(
            f"{result.source}: the result is no calibration ({error}); check units and axes of the"
            " recording"
        ) from None
    return result


ROUNDING = 1e-12  # of a sine: below it two unit vectors are the same, or opposite


def distinct_positions(periods: StationaryPeriods) -> int:
    """Count the positions whose verticals differ by `DISTINCT_RAD` and more.

    Parameters
    ----------
    periods : StationaryPeriods
        The stationary periods.

    Returns
    -------
    int
        Number of positions.
    """
    verticals: list[Array] = []
    for u in _unit_vectors(periods.accel_mean):
        if all(u @ vertical < np.cos(DISTINCT_RAD) for vertical in verticals):
            verticals.append(u)
    return len(verticals)


def local_gravity(latitude: float | None, height: float) -> tuple[float, float]:
    """Return gravity at a site and its standard deviation.

    Parameters
    ----------
    latitude : float or None
        Geodetic latitude, rad; None stands for anywhere.
    height : float
        Height above the ellipsoid, m.

    Returns
    -------
    gravity, sigma : float
        Gravity and its standard deviation, m/s^2.
    """
    if latitude is None:
        return STANDARD_GRAVITY, ANYWHERE_SIGMA
    return float(normal_gravity(latitude, height)), GRAVITY_SIGMA_MS2


def calibrate_accelerometers(
    periods: StationaryPeriods, gravity: float, gravity_sigma: float
) -> TriadEstimate:
    """Estimate the nine parameters of the accelerometers (P.1).

    Parameters
    ----------
    periods : StationaryPeriods
        The stationary periods.
    gravity, gravity_sigma : float
        Gravity and its standard deviation, m/s^2.

    Returns
    -------
    TriadEstimate
        Bias, scale factors and misalignments.
    """
    mean, entries = periods.accel_mean, places(ACCEL_STATES)
    sigma = _mean_sigma(periods.accel_std, periods.samples, "accel")

    def gravity_norm(p: Array) -> tuple[Array, Array]:
        M = np.linalg.inv(_response(p[3:], entries))
        f = (mean - p[:3]) @ M.T
        norm = np.linalg.norm(f, axis=1)
        row = (f / norm[:, None]) @ M
        jacobian = np.column_stack([-row, *(-row[:, j] * f[:, k] for j, k in entries)])
        return norm[:, None] - gravity, jacobian[:, None]

    fit = solve_groups(
        {"gravity": ResidualGroup(gravity_norm, np.square(sigma)[:, None, None], 9)},
        np.zeros(9),
        sizes(POSSIBLE, ACCEL_STATES),
    )
    scale = (
        np.concatenate(
            [np.zeros(3), [_response(fit.values[3:], entries)[entry] for entry in entries]]
        )
        / gravity
    )
    covariance = fit.covariance + gravity_sigma**2 * np.outer(scale, scale)
    blind = blind_directions(ACCEL_STATES, covariance)
    return TriadEstimate(
        "accel", ACCEL_STATES, fit.values, covariance, fit.residual, fit.factor, blind
    )


def calibrate_gyroscopes(
    periods: StationaryPeriods, turns: list[Turn], accel: TriadEstimate, latitude: float | None
) -> TriadEstimate:
    """Estimate the twelve parameters of the gyroscopes (P.2, P.3).

    The Earth's rate is a nuisance.

    Parameters
    ----------
    periods : StationaryPeriods
        The stationary periods.
    turns : list of Turn
        The turns between them.
    accel : TriadEstimate
        Estimate of the accelerometers on the same periods.
    latitude : float or None
        Geodetic latitude of the site, rad, where known.

    Returns
    -------
    TriadEstimate
        Bias, scale factors and misalignments.

    Raises
    ------
    DataError
        Where the gyros do not propagate the vertical from one position to the next.
    """
    from ...navigation.innovations._kernels import propagate_turn

    up, entries = _unit_vectors(accel.triad().correct(periods.accel_mean)), places(GYRO_STATES)
    C, linked = _attitudes(periods, turns, up)
    sigma = _mean_sigma(periods.gyro_std, periods.samples, "gyro")
    # where the heading is unknown, so is the Earth's rate
    sigma = np.hypot(sigma, np.where(linked, 0.0, EARTH_RATE))
    basis = np.linalg.svd(up[:, None, :])[2][:, 1:]  # (k, 2, 3), across the vertical

    def at_rest(p: Array) -> tuple[Array, Array]:
        E, rate = _response(p[3:12], entries), np.einsum("kji,j->ki", C, p[12:])
        jacobian = np.zeros((len(up), 3, 15))
        jacobian[:, :, :3] = -np.eye(3)
        for a in range(3):
            jacobian[:, a, 3 + 3 * a : 6 + 3 * a] = -rate
        jacobian[:, :, 12:] = -E @ np.swapaxes(C, 1, 2)
        return periods.gyro_mean - p[:3] - rate @ E.T, jacobian

    def turned(p: Array) -> tuple[Array, Array]:
        M = np.linalg.inv(_response(p[3:12], entries))
        residual, jacobian = np.empty((len(turns), 2)), np.zeros((len(turns), 2, 15))
        Rt, J = np.empty((3, 3)), np.empty((3, 12))
        for row, turn in enumerate(turns):
            i, length = turn.first, float(turn.dt.sum())
            propagate_turn(turn.delta, turn.dt, M, p[:3], Rt, J)
            v = Rt @ (up[i] + length * np.cross(C[i].T @ p[12:], up[i]))
            residual[row] = basis[i + 1] @ v
            jacobian[row, :, :12] = basis[i + 1] @ skew(v) @ J  # (P.4)
            jacobian[row, :, 12:] = -length * basis[i + 1] @ Rt @ skew(up[i]) @ C[i].T
        return residual.reshape(1, -1), jacobian.reshape(1, -1, 15)

    groups = {"rest": ResidualGroup(at_rest, np.square(sigma)[:, None, None] * np.eye(3), 3)}
    if turns:
        cov = _turn_covariance(periods, turns, accel, up, basis)
        groups["turns"] = ResidualGroup(turned, cov[None], 9)
    rate, rate_sigma = _earth_prior(latitude)
    fit = solve_groups(
        groups,
        np.concatenate([np.zeros(12), rate]),
        np.concatenate([sizes(POSSIBLE, GYRO_STATES), rate_sigma]),
    )
    astray = float(np.sqrt(np.mean(turned(fit.values)[0] ** 2))) if turns else 0.0
    if astray > ASTRAY:
        raise DataError(
            f"the gyros miss the vertical by {np.degrees(astray):.1f} deg (limit"
            f" {np.degrees(ASTRAY):.1f} deg) after {len(turns)} turns; axes or units of gyros and"
            " accelerometers contradict each other"
        )
    covariance = fit.covariance[:12, :12]
    blind = blind_directions(GYRO_STATES, covariance)
    return TriadEstimate(
        "gyro", GYRO_STATES, fit.values[:12], covariance, fit.residual, fit.factor, blind
    )


def find_turns(imu: ImuSamples, periods: StationaryPeriods) -> list[Turn]:
    """Find the turns from each stationary period to the next that were recorded without a gap.

    Parameters
    ----------
    imu : ImuSamples
        The recording.
    periods : StationaryPeriods
        The stationary periods.

    Returns
    -------
    list of Turn
        The turns.
    """
    nominal = nominal_interval(imu.time)
    step = np.diff(imu.time)
    delta = imu.gyro[1:] if imu.quantity == "increments" else imu.gyro[1:] * step[:, None]
    if imu.quantity == "instant_rate":
        delta = 0.5 * (imu.gyro[1:] + imu.gyro[:-1]) * step[:, None]
    turns = []
    for i in range(len(periods) - 1):
        a, b = np.searchsorted(imu.time, [periods.time[i, 1], periods.time[i + 1, 0]])
        length = imu.time[b] - imu.time[a]
        if b > a and step[a:b].max() < LEAST_GAP_INTERVALS * nominal and length < LONGEST_TURN_S:
            sigma = float(np.sqrt(np.mean(periods.gyro_std[i : i + 2] ** 2) * nominal * length))
            turns.append(Turn(i, _rotation_vectors(delta[a:b]), step[a:b].copy(), sigma))
    return turns


def _rotation_vectors(delta: Array) -> Array:
    """Return rotation vectors (n, 3) of increments, coning included.

    Each takes the part that turns across its neighbours make (I.2 of
    `navigation.prepare.increments`).
    """
    out = delta.copy()
    coning = np.cross(delta[:-1], delta[1:]) / 24.0
    out[:-1] += coning
    out[1:] += coning
    return out


def _turn_covariance(
    periods: StationaryPeriods, turns: list[Turn], accel: TriadEstimate, up: Array, basis: Array
) -> Array:
    """Return the covariance (2 t, 2 t) of the residuals of (P.3).

    It holds the white noise of the gyros, the verticals that two turns share and the
    accelerometers' calibration that all share.
    """
    from ...navigation.innovations._kernels import propagate_turn

    bias = np.average(periods.gyro_mean, axis=0, weights=periods.samples)
    noise = _mean_sigma(periods.accel_std, periods.samples, "accel") * np.sqrt(
        max(1.0, accel.variance_factor["gravity"])
    )
    by_period = np.zeros((len(turns), 2, len(up), 3))
    by_parameter = np.zeros((len(turns), 2, len(accel.states)))
    effect = np.zeros((len(up), 3, len(accel.states)))  # of the parameters on u, to first order
    effect[:, :, :3] = -np.eye(3) / STANDARD_GRAVITY
    for column, (j, k) in enumerate(places(accel.states), 3):
        effect[:, j, column] = -up[:, k]
    Rt, J = np.empty((3, 3)), np.empty((3, 12))
    for row, turn in enumerate(turns):
        i = turn.first
        propagate_turn(turn.delta, turn.dt, np.eye(3), bias, Rt, J)
        ends = {i: basis[i + 1] @ Rt, i + 1: -basis[i + 1]}
        for period, matrix in ends.items():
            by_period[row, :, period] = matrix * noise[period] / STANDARD_GRAVITY
            by_parameter[row] += matrix @ effect[period]
    A, D = by_period.reshape(2 * len(turns), -1), by_parameter.reshape(2 * len(turns), -1)
    white = np.repeat([turn.sigma**2 + LEAST_TURN_RAD**2 for turn in turns], 2)
    return np.asarray(np.diag(white) + A @ A.T + D @ accel.covariance @ D.T, dtype=np.float64)


def _attitudes(
    periods: StationaryPeriods, turns: list[Turn], up: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Return C_i (k, 3, 3), and whether their headings are known (k,).

    They are levelled by the accelerometers, their headings propagated by the gyros as they are.
    """
    from ...navigation.innovations._kernels import propagate_turn

    bias = np.average(periods.gyro_mean, axis=0, weights=periods.samples)
    C = np.empty((len(up), 3, 3))
    linked = np.zeros(len(up), dtype=bool)
    turn_to = {turn.first + 1: turn for turn in turns}
    Rt, J = np.empty((3, 3)), np.empty((3, 12))
    for i, u in enumerate(up):
        rough = np.eye(3)
        linked[i] = i == 0
        if i in turn_to:
            propagate_turn(turn_to[i].delta, turn_to[i].dt, np.eye(3), bias, Rt, J)
            rough = C[i - 1] @ Rt.T
            linked[i] = linked[i - 1]
        C[i] = _rotation_to_up(rough @ u) @ rough
    return C, linked


def _rotation_to_up(v: Array) -> Array:
    """Return the shortest rotation (3, 3) of the unit vector v onto up in north-east-down."""
    up = np.array([0.0, 0.0, -1.0])
    axis = np.cross(v, up)
    cosine = float(v @ up)
    sine = float(np.linalg.norm(axis))
    if sine < ROUNDING:
        return np.eye(3) if cosine > 0.0 else np.diag([1.0, -1.0, -1.0])
    return rotation_from_vector(axis / sine * np.arctan2(sine, cosine))


def _earth_prior(latitude: float | None) -> tuple[Array, Array]:
    """Return mean and standard deviation (3,), rad/s, of the Earth's rate in a level frame.

    The heading of the frame is unknown; latitude is in rad.
    """
    if latitude is None:
        return np.zeros(3), np.full(3, EARTH_RATE / np.sqrt(3.0))
    across = EARTH_RATE * abs(np.cos(latitude)) / np.sqrt(2.0)
    return (
        np.array([0.0, 0.0, -EARTH_RATE * np.sin(latitude)]),
        np.array([across, across, 1e-3 * EARTH_RATE]) + 1e-12,
    )


def _response(values: Array, entries: list[tuple[int, int]]) -> Array:
    """Return E (3, 3) of the parameters after the bias."""
    E = np.eye(3)
    for entry, value in zip(entries, values, strict=True):
        E[entry] += value
    return E


def _unit_vectors(v: Array) -> Array:
    """Return vectors (n, 3) over their lengths."""
    return np.asarray(v / np.linalg.norm(v, axis=1, keepdims=True), dtype=np.float64)


def _mean_sigma(std: Array, samples: NDArray[np.int64], sensor: str) -> Array:
    """Return the standard deviation (k,) of the mean of white noise, of any axis."""
    return np.asarray(
        np.maximum(np.sqrt(np.mean(std**2, axis=1) / samples), LEAST_SIGMA[sensor]),
        dtype=np.float64,
    )
