"""Transition and noise of the core between two epochs as full matrices, which it never forms."""

from dataclasses import dataclass

import numpy as np

from insgnss.navigation.filter.codes import IMU_STATES, N_NAV, NAV
from insgnss.navigation.filter.kernels.error_model import linearise
from insgnss.navigation.filter.kernels.records import (
    BiasCourse,
    Earth,
    IntegrationIntervals,
    StateModel,
    make_interval_work,
)
from insgnss.records import Array


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
    course = BiasCourse(elapsed)
    F, D, W, Qbb = np.zeros((N_NAV, n)), np.zeros(ns), np.zeros((1, N_NAV, n)), np.zeros((1, ns))
    linearise(
        intervals, first, last, course, nav, x, model, earth, F, D, W, Qbb, make_interval_work(ns)
    )
    Phi, Q = np.zeros((n, n)), np.zeros((n, n))
    Phi[NAV] = F
    Phi[IMU_STATES, IMU_STATES] = np.diag(D)
    Q[NAV] = W[0]
    Q[IMU_STATES, NAV] = W[0, :, IMU_STATES].T
    Q[IMU_STATES, IMU_STATES] = np.diag(Qbb[0])
    return Interval(nav, x, Phi, Q)
