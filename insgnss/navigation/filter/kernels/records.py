"""What the kernels take and fill: named tuples of arrays, which numba takes apart at no cost."""

from typing import NamedTuple

import numpy as np

from ....base.compilation import njit
from ..codes import N_CHANNELS, N_NAV


class IntegrationIntervals(NamedTuple):
    """Body increments between consecutive time marks; every epoch of the filter is a mark.

    Parameters
    ----------
    dt : ndarray
        (s,) lengths, s.
    dtheta : ndarray
        (s, 3) angle increments, body axes, rad.
    dvel : ndarray
        (s, 3) velocity increments, body axes, m/s.
    """

    dt: np.ndarray
    dtheta: np.ndarray
    dvel: np.ndarray


class Earth(NamedTuple):
    """The local frame l as the kernels see it.

    Parameters
    ----------
    origin_ecef : ndarray
        (3,) origin of l in ECEF, m.
    C_el : ndarray
        (3, 3) rotation from l to ECEF.
    rate_l : ndarray
        (3,) rotation of the Earth in l, rad/s.
    """

    origin_ecef: np.ndarray
    C_el: np.ndarray
    rate_l: np.ndarray


class StateModel(NamedTuple):
    """The error states behind those of navigation as arrays, see `layout`.

    Parameters
    ----------
    channel : ndarray
        (ns,) 0..2 gyro x y z, 3..5 accelerometer x y z.
    factor : ndarray
        (ns,) BIAS, DRIFT, AIDING_ERROR or the channel whose measured value it is.
    beta : ndarray
        (ns,) 1/s, inverse correlation time, 0 for none.
    drive : ndarray
        (q, ns) PSD of the driving noise, of each of q components of the noise.
    white : ndarray
        (q, 6) PSD of the white noise of each channel.
    block : float
        Length over which the transition is built as one step, s.
    lever : int
        First of the three states of the antenna's lever arm, or ABSENT.
    offset : int
        The state of the fixes' time offset, or ABSENT.
    rate : int
        The state of its rate, or ABSENT.
    gm : ndarray
        (3,) first of the three states of the time-correlated (Gauss-Markov) error of all fixes, of
        those of UNFIXED_GROUP besides, and of the velocities, or ABSENT.
    white_scale : ndarray
        (3, 3) sigma of the white error of each group, and of the velocities, in their standard
        deviations.
    barometer : int
        The state of the barometer's bias, with that of its scale factor behind it, or ABSENT.
    """

    channel: np.ndarray
    factor: np.ndarray
    beta: np.ndarray
    drive: np.ndarray
    white: np.ndarray
    block: float
    lever: int
    offset: int
    rate: int
    gm: np.ndarray
    white_scale: np.ndarray
    barometer: int


class BiasCourse(NamedTuple):
    """What biases that follow a course are multiplied with at an instant.

    Parameters
    ----------
    elapsed : float
        Time since the start of the recording, s.
    temperature, warming : float
        That of the IMU above its mean, in its range over the recording, and its change, 1/s.
    """

    elapsed: float
    temperature: float = 0.0
    warming: float = 0.0


class BlockIntegrals(NamedTuple):
    """What the strapdown leaves of a block for the error model (E.4, E.5).

    Parameters
    ----------
    C : ndarray
        (3, 3) s, integral of C_lb.
    s1 : ndarray
        (3,) m/s, integral of the specific force in l.
    s2 : ndarray
        (3,) m, integral of s1.
    """

    C: np.ndarray
    s1: np.ndarray
    s2: np.ndarray


class IntervalWork(NamedTuple):
    """Scratch of one interval between epochs.

    Parameters
    ----------
    decay : ndarray
        (ns,) of the block.
    mean : ndarray
        (ns,) mean over the block of a state that starts at one.
    last_block : ndarray
        (1,) s, the block length that decay and mean hold for.
    weight : ndarray
        (ns,) factor of each state, mean over the block.
    bias : ndarray
        (2, 6) at the start and at the end of the block.
    scale : ndarray
        (6, 6) scale factors and misalignments.
    integrals : BlockIntegrals
        Integrals of the block.
    column : ndarray
        (9, 6) effect of a unit error of each channel over the block.
    group : ndarray
        (6, 9) scratch.
    share : ndarray
        (ns,) scratch.
    driven : ndarray
        (6,) scratch.
    X : ndarray
        (9, n) scratch.
    v9 : ndarray
        (9,) scratch.
    """

    decay: np.ndarray
    mean: np.ndarray
    last_block: np.ndarray
    weight: np.ndarray
    bias: np.ndarray
    scale: np.ndarray
    integrals: BlockIntegrals
    column: np.ndarray
    group: np.ndarray
    share: np.ndarray
    driven: np.ndarray
    X: np.ndarray
    v9: np.ndarray


class Epochs(NamedTuple):
    """The filter's epochs: instants at which something is measured or wanted.

    Parameters
    ----------
    stop : ndarray
        (m,) number of integration intervals before the epoch.
    time : ndarray
        (m,) s since the start.
    has_position : ndarray
        (m,) bool.
    position : ndarray
        (m, 3) m, antenna in l.
    position_cov : ndarray
        (m, 3, 3) m^2, in l.
    withheld : ndarray
        (m,) bool, whether the position is looked at and not used.
    has_velocity : ndarray
        (m,) bool.
    velocity : ndarray
        (m, 3) m/s, antenna in l.
    velocity_cov : ndarray
        (m, 3, 3) m^2/s^2, in l.
    rate : ndarray
        (m, 3) rad/s, measured gyro rate at the epoch.
    temperature : ndarray
        (m,) of the IMU above its mean, in its range over the recording; 0 where it is not known.
    event : ndarray
        (m,) number of the camera event at the epoch, or ABSENT.
    sigma : ndarray
        (m, 3) m, of the fix in steps of two: unit of its time-correlated errors.
    group : ndarray
        (m,) of the fix: FIXED_GROUP or UNFIXED_GROUP.
    gap : ndarray
        (m, 6) variance of the increments since the epoch before where a gap of the IMU was bridged
        (rad^2, m^2/s^2), else 0.
    bias_step : ndarray
        (m, 6) variance by which each channel's constant bias may have stepped since the epoch
        before ((rad/s)^2, (m/s^2)^2), else 0.
    constraint : ndarray
        (m,) NO_CONSTRAINT, ZUPT or NHC.
    constraint_cov : ndarray
        (m, 3, 3) m^2/s^2, of ZUPT (K.8) in l, of NHC (K.9) in body axes.
    zaru_rate : ndarray
        (m, 3) rad/s, mean gyro rate of a stationary period that ends here.
    zaru_variance : ndarray
        (m,) its variance in each axis, 0 where there is none.
    barometer_height : ndarray
        (m,) m, of a barometer above the origin of l.
    barometer_variance : ndarray
        (m,) m^2, 0 where there is none.
    linear_H : ndarray
        (m, g, 3, 12 + q) derivatives of g linearised measurements (K.13) by the errors of
        navigation, the biases of the gyros and the q states of these measurements.
    linear_residual : ndarray
        (m, g, 3) measured minus predicted at `linear_about`.
    linear_cov : ndarray
        (m, g, 3, 3) their covariances, 0 where there is none.
    linear_about : ndarray
        (m, 13 + q) nominal, biases of the gyros and the q states that they are linearised about.
    """

    stop: np.ndarray
    time: np.ndarray
    has_position: np.ndarray
    position: np.ndarray
    position_cov: np.ndarray
    withheld: np.ndarray
    has_velocity: np.ndarray
    velocity: np.ndarray
    velocity_cov: np.ndarray
    rate: np.ndarray
    temperature: np.ndarray
    event: np.ndarray
    sigma: np.ndarray
    group: np.ndarray
    gap: np.ndarray
    bias_step: np.ndarray
    constraint: np.ndarray
    constraint_cov: np.ndarray
    zaru_rate: np.ndarray
    zaru_variance: np.ndarray
    barometer_height: np.ndarray
    barometer_variance: np.ndarray
    linear_H: np.ndarray
    linear_residual: np.ndarray
    linear_cov: np.ndarray
    linear_about: np.ndarray


class ForwardOptions(NamedTuple):
    """What the forward pass decides by.

    Parameters
    ----------
    closed_loop : bool
        Feed the error estimate back into the nominal state.
    feedback_threshold : float
        Standard deviation of psi, rad, below which the error estimate is fed back.
    gate : ndarray
        (kinds,) NIS above which a triple of each kind is rejected.
    huber_threshold : float
        NIS above which a triple gets a larger covariance (K.11).
    reset_after : float
        S of rejected fixes after which the covariance is reset (K.7).
    """

    closed_loop: bool
    feedback_threshold: float
    gate: np.ndarray
    huber_threshold: float
    reset_after: float


class Triple(NamedTuple):
    """Three measured scalars of one kind at one epoch; the arrays are used again by the next.

    Parameters
    ----------
    H : ndarray
        (3, n) derivative of the measurement.
    nu : ndarray
        (3, 1) innovation of the nominal.
    R : ndarray
        (3, 3) covariance.
    C_lb : ndarray
        (3, 3) rotation from the body to l.
    lever : ndarray
        (3,) m, lever arm with its error states, body axes.
    omega : ndarray
        (3,) rad/s, of the body against the Earth, body axes.
    gain : ndarray
        (ns,) minus the derivative of omega by each state, on the state's own axis.
    difference : ndarray
        (n + 3,) scratch.
    """

    H: np.ndarray
    nu: np.ndarray
    R: np.ndarray
    C_lb: np.ndarray
    lever: np.ndarray
    omega: np.ndarray
    gain: np.ndarray
    difference: np.ndarray


class FilterState(NamedTuple):
    """The filter between two epochs: where a pass stands, and from where it may be run again.

    Parameters
    ----------
    nav : ndarray
        (10,) nominal position (m) and velocity (m/s) in l, quaternion q_lb.
    x : ndarray
        (ns,) nominal values of the other states.
    m : ndarray
        (n,) error estimate about the nominal.
    P : ndarray
        (n, n) covariance of the errors.
    cross : ndarray
        (9, n) covariance of the latest event's navigation error with the errors now.
    flags : ndarray
        (2,) int, whether the estimate is fed back already, and whether `cross` is followed.
    times : ndarray
        (2,) s: since when fixes are rejected, or NaN, and the length of block that the decay of the
        states was worked out for, negative for none.
    """

    nav: np.ndarray
    x: np.ndarray
    m: np.ndarray
    P: np.ndarray
    cross: np.ndarray
    flags: np.ndarray
    times: np.ndarray


class FilterHistory(NamedTuple):
    """What the forward pass leaves at each epoch; post: after the update at that epoch.

    m, P, F, D, H and K are the records that the smoother alone reads: where nothing is smoothed
    they have one row, that of the last epoch, and where the pass goes block by block
    (`navigation.filter.blocks`) the rows of some blocks.

    Parameters
    ----------
    nav : ndarray
        (m, 10) nominal, post.
    x : ndarray
        (m, ns) nominal, post.
    m : ndarray
        (m, n) error estimate about the nominal, post (zero after feedback).
    P : ndarray
        (m, n, n) post.
    sigma : ndarray
        (m, 9) of the navigation states in the filter, post.
    F : ndarray
        (m, 9, n) navigation rows of the transition from the previous epoch to this one.
    D : ndarray
        (m, ns) of the diagonal states, from the previous epoch to this one.
    H : ndarray
        (m, nz, most columns used) whitened rows.
    K : ndarray
        (m, nz, n) gains of the scalar updates.
    S : ndarray
        (m, nz) innovation variances of the scalar updates, 0 where there was none.
    y : ndarray
        (m, nz) scalar innovations.
    innovation : ndarray
        (m, nz) of the triples as measured, before the update.
    innovation_sigma : ndarray
        (m, nz) their standard deviations.
    nis : ndarray
        (m, kinds) normalised innovation squared of each kind, NaN where there was none.
    verdict : ndarray
        (m, kinds) of each kind: NOT_MEASURED, USED, REJECTED or COVARIANCE_RESET.
    slot : ndarray
        (kinds,) first row of each kind in the arrays of nz rows, or ABSENT.
    used : ndarray
        (nz,) number of leading columns of H that may differ from zero.
    cross : ndarray
        (events, 9, n) of the previous event's navigation error with this event's full error, post;
        events of a block where the pass goes block by block.
    outage : ndarray
        (m,) the slot of the interval before this epoch in W and Qbb, where it lies between two
        fixes that are far apart, else ABSENT.
    W : ndarray
        (slots, 9, n) process noise of such intervals, [Q_nn Q_nb].
    Qbb : ndarray
        (slots, ns) its diagonal behind.
    """

    nav: np.ndarray
    x: np.ndarray
    m: np.ndarray
    P: np.ndarray
    sigma: np.ndarray
    F: np.ndarray
    D: np.ndarray
    H: np.ndarray
    K: np.ndarray
    S: np.ndarray
    y: np.ndarray
    innovation: np.ndarray
    innovation_sigma: np.ndarray
    nis: np.ndarray
    verdict: np.ndarray
    slot: np.ndarray
    used: np.ndarray
    cross: np.ndarray
    outage: np.ndarray
    W: np.ndarray
    Qbb: np.ndarray


@njit(cache=True)
def make_integrals():
    """Return the integrals of a block, all zero.

    Returns
    -------
    BlockIntegrals
        New arrays.
    """
    return BlockIntegrals(np.zeros((3, 3)), np.zeros(3), np.zeros(3))


@njit(cache=True)
def make_interval_work(ns):
    """Return scratch for an interval between epochs.

    Parameters
    ----------
    ns : int
        Number of states behind those of navigation.

    Returns
    -------
    IntervalWork
        New arrays.
    """
    n = N_NAV + ns
    return IntervalWork(
        np.zeros(ns),
        np.zeros(ns),
        np.full(1, -1.0),
        np.zeros(ns),
        np.zeros((2, N_CHANNELS)),
        np.zeros((N_CHANNELS, N_CHANNELS)),
        make_integrals(),
        np.zeros((N_NAV, N_CHANNELS)),
        np.zeros((N_CHANNELS, N_NAV)),
        np.zeros(ns),
        np.zeros(N_CHANNELS),
        np.zeros((N_NAV, n)),
        np.zeros(N_NAV),
    )


@njit(cache=True)
def make_triple(ns):
    """Return a triple, all zero.

    Parameters
    ----------
    ns : int
        Number of states behind those of navigation.

    Returns
    -------
    Triple
        New arrays.
    """
    return Triple(
        np.zeros((3, N_NAV + ns)),
        np.zeros((3, 1)),
        np.zeros((3, 3)),
        np.zeros((3, 3)),
        np.zeros(3),
        np.zeros(3),
        np.zeros(ns),
        np.zeros(N_NAV + ns + 3),
    )
