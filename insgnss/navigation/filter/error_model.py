"""The linear model of the errors between two epochs: transition and process noise.

Errors are truth minus estimate, attitude ``C(true) = exp([psi x]) C(estimate)`` in the axes of l.
With a = C_lb f, the channel errors db_g and db_a (sums of IMU error states) and white noise w:

    dp' = dv                                                                                  (E.1)
    dv' = -[a x] psi - C_lb (db_a + w_a) + G dp - 2 [Omega x] dv                              (E.2)
    psi' = -[Omega x] psi - C_lb (db_g + w_g)                                                 (E.3)

G = diag(-g/R, -g/R, 2 g/R) is the gravity gradient. The epoch's interval is cut into blocks of at
most `block` seconds. Over a block of length B the samples give S_C, the integral of C_lb, s1, that
of a, and s2, that of s1. The block's transition is

    psi <- psi - B Omega x psi
    v   <- v - s1 x psi + B (G p - 2 Omega x v)
    p   <- p + B v - s2 x psi                                                                 (E.4)

and a unit constant error of gyro axis i (column e of S_C) and of accelerometer axis i adds

    psi: -e,  v: s1 x e / 2,  p: B s1 x e / 6          and          v: -e,  p: -B e / 2       (E.5)

times the mean of the state over the block, (1 - exp(-beta B)) / (beta B). What (E.4, E.5) leave out
within one block is a relative 1e-2 of terms that are themselves small; across blocks the
composition is exact. The joint covariance of the navigation errors with the IMU states driven since
the last epoch, W = [Q_nn Q_nb] and the diagonal Q_bb, goes along:

    W <- Phi W Phi' + block noise
    Q_bb <- d^2 Q_bb + drive (1 - d^2) / (2 beta),   d = exp(-beta B)                         (E.6)
    block noise: white noise integrated once (psi, v), twice (p of accelerometers, v of gyros),
    three times (p of gyros); driving noise q of a state with column c: c c' q B/3 on Q_nn, c q B/2
    on
    Q_nb                                                                                      (E.7)

An interval of length B that the IMU did not see, bridged by increments of variance q in channel i
with column c_i of (E.5), adds

    c_i c_i' q / B^2  on Q_nn                                                                 (E.8)

At an epoch before which the constant bias of channel i may step, with variance v_i,

    v_i  on Q_bb of that bias                                                                 (E.9)
"""

from dataclasses import dataclass

import numpy as np

from ...records import Array
from .codes import IMU, N_NAV, NAV
from .kernels.error_model import linearise
from .kernels.records import Earth, IntegrationIntervals, StateModel, make_interval_work


@dataclass(frozen=True)
class Interval:
    """The interval between two epochs, linearised.

    Parameters
    ----------
    nav, x : Array
        (10,) and (ns,) the nominal at its end.
    Phi : Array
        (n, n) transition of the errors.
    Q : Array
        (n, n) process noise of the errors.
    """

    nav: Array
    x: Array
    Phi: Array
    Q: Array


def linearise_interval(
    intervals: IntegrationIntervals,
    first: int,
    last: int,
    nav: Array,
    x: Array,
    model: StateModel,
    earth: Earth,
    elapsed: float = 0.0,
) -> Interval:
    """Propagate the nominal; return transition and noise of the errors as full matrices.

    The filter runs the same kernel without forming the full matrices.

    Parameters
    ----------
    intervals : IntegrationIntervals
        Body increments.
    first, last : int
        The integration intervals first..last - 1 are passed.
    nav, x : Array
        (10,) and (ns,) the nominal at the start.
    model : StateModel
        The error states behind those of navigation.
    earth : Earth
        The local frame.
    elapsed : float
        Seconds since the start of the recording, at the start of the interval.

    Returns
    -------
    Interval
        The nominal at the end, transition and noise.
    """
    ns = model.channel.size
    n = N_NAV + ns
    nav, x = nav.copy(), x.copy()
    F, D, W, Qbb = np.zeros((N_NAV, n)), np.zeros(ns), np.zeros((1, N_NAV, n)), np.zeros((1, ns))
    linearise(
        intervals, first, last, elapsed, nav, x, model, earth, F, D, W, Qbb, make_interval_work(ns)
    )
    Phi, Q = np.zeros((n, n)), np.zeros((n, n))
    Phi[NAV] = F
    Phi[IMU, IMU] = np.diag(D)
    Q[NAV] = W[0]
    Q[IMU, NAV] = W[0, :, IMU].T
    Q[IMU, IMU] = np.diag(Qbb[0])
    return Interval(nav, x, Phi, Q)
