"""What the kernels take and fill: named tuples of arrays, which numba takes apart at no cost."""

from typing import NamedTuple

import numpy as np

from ...base.compilation import njit
from ..codes import N_CHANNELS, N_NAV


class IntegrationIntervals(NamedTuple):
    """Body increments between consecutive time marks; every epoch of the filter is a mark."""

    dt: np.ndarray  # (s,) s
    dtheta: np.ndarray  # (s, 3) rad
    dvel: np.ndarray  # (s, 3) m/s


class Earth(NamedTuple):
    """The local frame l as the kernels see it."""

    origin_ecef: np.ndarray  # (3,) m
    C_el: np.ndarray  # (3, 3)
    rate_l: np.ndarray  # (3,) rad/s, Earth rotation in l


class StateModel(NamedTuple):
    """The error states behind those of navigation as arrays, see `layout`."""

    channel: np.ndarray  # (ns,) 0..2 gyro x y z, 3..5 accelerometer x y z
    factor: np.ndarray  # (ns,) BIAS, DRIFT, FIX_ERROR or the channel whose measured value it is
    beta: np.ndarray  # (ns,) 1/s, inverse correlation time, 0 for none
    drive: np.ndarray  # (ns,) PSD of the driving noise
    white: np.ndarray  # (6,) PSD of the white noise of each channel
    block: float  # s, length over which the transition is built as one step
    lever: int  # first of the three states of the antenna's lever arm, or ABSENT
    offset: int  # the state of the fixes' time offset, or ABSENT
    rate: int  # the state of its rate, or ABSENT
    gm: np.ndarray  # (2,) first of the three states of the time-correlated (Gauss-Markov) error of
    # all fixes, and of those of UNFIXED_GROUP besides, or ABSENT
    white_scale: np.ndarray  # (2, 3) of the standard deviations of each group's white error


class BlockIntegrals(NamedTuple):
    """What the strapdown leaves of a block for the error model (E.4, E.5)."""

    C: np.ndarray  # (3, 3) s, integral of C_lb
    s1: np.ndarray  # (3,) m/s, integral of the specific force in l
    s2: np.ndarray  # (3,) m, integral of s1


class IntervalWork(NamedTuple):
    """Scratch of one interval between epochs."""

    decay: np.ndarray  # (ns,) of the block
    mean: np.ndarray  # (ns,) mean over the block of a state that starts at one
    last_block: np.ndarray  # (1,) s, the block length that decay and mean hold for
    weight: np.ndarray  # (ns,) factor of each state, mean over the block
    bias: np.ndarray  # (2, 6) at the start and at the end of the block
    scale: np.ndarray  # (6, 6) scale factors and misalignments
    integrals: BlockIntegrals
    column: np.ndarray  # (9, 6) effect of a unit error of each channel over the block
    group: np.ndarray  # (9, 6)
    X: np.ndarray  # (9, n)
    Y: np.ndarray  # (9, 9)
    v9: np.ndarray  # (9,)


class Epochs(NamedTuple):
    """The filter's epochs: instants at which something is measured or wanted."""

    stop: np.ndarray  # (m,) number of integration intervals before the epoch
    time: np.ndarray  # (m,) s since the start
    has_position: np.ndarray  # (m,) bool
    position: np.ndarray  # (m, 3) m, antenna in l
    position_cov: np.ndarray  # (m, 3, 3) m^2, in l
    has_velocity: np.ndarray  # (m,) bool
    velocity: np.ndarray  # (m, 3) m/s, antenna in l
    velocity_cov: np.ndarray  # (m, 3, 3) m^2/s^2, in l
    rate: np.ndarray  # (m, 3) rad/s, measured gyro rate at the epoch
    event: np.ndarray  # (m,) number of the camera event at the epoch, or ABSENT
    sigma: np.ndarray  # (m, 3) m, of the fix in steps of two: unit of its time-correlated errors
    group: np.ndarray  # (m,) of the fix: FIXED_GROUP or UNFIXED_GROUP
    gap: np.ndarray  # (m, 6) variance of the increments since the epoch before where a gap of the
    # IMU was bridged (rad^2, m^2/s^2), else 0
    constraint: np.ndarray  # (m,) NO_CONSTRAINT, ZUPT or NHC
    constraint_cov: np.ndarray  # (m, 3, 3) m^2/s^2, of ZUPT (K.8) in l, of NHC (K.9) in body axes
    zaru_rate: np.ndarray  # (m, 3) rad/s, mean gyro rate of a stationary period that ends here
    zaru_variance: np.ndarray  # (m,) its variance in each axis, 0 where there is none


class FilterOptions(NamedTuple):
    """What the forward pass decides by."""

    closed_loop: bool  # feed the error estimate back into the nominal state
    feedback_threshold: float  # rad, psi must be known this well before anything is fed back
    gate: float  # NIS above which a triple is rejected
    huber_threshold: float  # NIS above which a triple gets a larger covariance (K.11)
    reset_after: float  # s of rejected fixes after which the covariance is reset (K.7)


class Triple(NamedTuple):
    """Three measured scalars of one kind at one epoch; the arrays are used again by the next."""

    H: np.ndarray  # (3, n) derivative
    nu: np.ndarray  # (3, 1) innovation of the nominal
    R: np.ndarray  # (3, 3) covariance
    C_lb: np.ndarray  # (3, 3)
    lever: np.ndarray  # (3,) m, lever arm with its error states, body axes
    omega: np.ndarray  # (3,) rad/s, of the body against the Earth, body axes
    gain: np.ndarray  # (ns,) minus the derivative of omega by each state, on the state's own axis


class FilterHistory(NamedTuple):
    """What the forward pass leaves at each epoch; post: after the update at that epoch."""

    nav: np.ndarray  # (m, 10) nominal, post
    x: np.ndarray  # (m, ns) nominal, post
    m: np.ndarray  # (m, n) error estimate about the nominal, post (zero after feedback)
    P: np.ndarray  # (m, n, n) post; the smoother writes its own covariance over it
    sigma: np.ndarray  # (m, n) of the filter, post
    F: np.ndarray  # (m, 9, n) from the previous epoch to this one
    D: np.ndarray  # (m, ns)
    H: np.ndarray  # (m, nz, most columns used) whitened rows
    K: np.ndarray  # (m, nz, n) gains of the scalar updates
    S: np.ndarray  # (m, nz) innovation variances of the scalar updates, 0 where there was none
    y: np.ndarray  # (m, nz) scalar innovations
    innovation: np.ndarray  # (m, nz) of the triples as measured, before the update
    innovation_sigma: np.ndarray  # (m, nz)
    nis: np.ndarray  # (m, 4) normalised innovation squared of each kind, NaN where there was none
    verdict: np.ndarray  # (m, 4) of each kind: NOT_MEASURED, USED, REJECTED or COVARIANCE_RESET
    slot: np.ndarray  # (4,) first row of each kind in the arrays of nz rows, or ABSENT
    used: np.ndarray  # (nz,) number of leading columns of H that may differ from zero
    cross: np.ndarray  # (events, 9, n) of the previous event's navigation error with this event's
    # full error, post


@njit(cache=True)
def make_integrals():
    """Integrals of a block, zero."""
    return BlockIntegrals(np.zeros((3, 3)), np.zeros(3), np.zeros(3))


@njit(cache=True)
def make_interval_work(ns):
    """Scratch of an interval for ns states behind those of navigation."""
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
        np.zeros((N_NAV, N_CHANNELS)),
        np.zeros((N_NAV, n)),
        np.zeros((N_NAV, N_NAV)),
        np.zeros(N_NAV),
    )


@njit(cache=True)
def make_triple(ns):
    """A triple for ns states behind those of navigation."""
    return Triple(
        np.zeros((3, N_NAV + ns)),
        np.zeros((3, 1)),
        np.zeros((3, 3)),
        np.zeros((3, 3)),
        np.zeros(3),
        np.zeros(3),
        np.zeros(ns),
    )
