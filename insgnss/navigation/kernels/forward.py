"""The filter (K.1-K.11) over all epochs: predict, measure, update."""

import numpy as np

from ...compilation import njit
from ..codes import (
    ABSENT,
    AX,
    AY,
    AZ,
    COVARIANCE_RESET,
    IMU0,
    N_KINDS,
    N_NAV,
    NAV,
    NOT_MEASURED,
    POSITION,
    REJECTED,
    USED,
    VEL0,
)
from .error_model import add_gap_noise, linearise, predict_covariance, propagate_mean
from .measurements import measured_triple
from .records import FilterState, make_epoch_work, make_interval_work, make_triple
from .update import (
    cholesky3,
    feed_back,
    forward_solve3,
    innovation_test,
    reset_covariance,
    scalar_update,
    state_difference,
)


@njit(cache=True)
def predict(e, intervals, epochs, model, earth, closed_loop, fed_back, track_cross, state, work, epoch_work, history):
    """State and covariance from epoch e - 1 to epoch e; transition and noise stay in the history.

    In closed loop the nominal is what the strapdown makes of the state; else it is the history's, and
    the gap between the two enters the mean (K.6). Once fed back the mean is zero and stays so.
    """
    nav, x, m = state.nav, state.x, state.m
    W, Qbb, gap, acceleration = epoch_work.W, epoch_work.Qbb, epoch_work.gap, epoch_work.acceleration
    if not closed_loop:
        nav[:] = history.nav[e - 1]
        x[:] = history.x[e - 1]
    F = history.F[e]
    D = history.D[e]
    length = epochs.time[e] - epochs.time[e - 1]
    for i in range(3):
        acceleration[i] = nav[VEL0 + i]
    linearise(intervals, epochs.stop[e - 1], epochs.stop[e], epochs.time[e - 1], nav, x, model, earth, F, D, W, Qbb, work)
    for i in range(3):
        acceleration[i] = (nav[VEL0 + i] - acceleration[i]) / length
    if epochs.gap[e, 0] > 0.0:
        add_gap_noise(W, work.column, work.last_block[0], epochs.gap[e])
    predict_covariance(state.P, F, D, W, Qbb, epoch_work.X, epoch_work.nine)
    if closed_loop:
        gap[:] = 0.0
    else:
        state_difference(nav, x, history.nav[e], history.x[e], gap)
    if not (closed_loop and fed_back):
        propagate_mean(F, D, m, gap, epoch_work.mean)
    if track_cross:
        cross, nine = state.cross, epoch_work.nine
        np.dot(cross, F.T, nine)
        for r in range(N_NAV):
            for c in range(N_NAV):
                cross[r, c] = nine[r, c]
            for c in range(IMU0, m.size):
                cross[r, c] *= D[c - IMU0]


@njit(cache=True)
def update(e, epochs, model, earth, lever_b, options, track_cross, rejected_since, state, triple, work, history):
    """Take what epoch e measures, kind by kind. Returns the first of the rejected fixes in a row, or ABSENT.

    Velocity comes after position: its nominal is still the one before feedback, m carries the rest.
    """
    H, nu, R, L, innovation = triple.H, triple.nu, triple.R, work.L, work.innovation
    wide = history.H.shape[2]
    for kind in range(N_KINDS):
        history.verdict[e, kind] = NOT_MEASURED
        b = history.slot[kind]
        if b == ABSENT:
            continue
        if not measured_triple(kind, e, epochs, state.nav, state.x, lever_b, work.acceleration, model, earth, triple):
            continue
        used = history.used[b]
        for i in range(3):
            history.S[e, b + i] = 0.0
        nis = innovation_test(state.P, H, nu, state.m, R, used, work.S, L, innovation)
        history.nis[e, kind] = nis
        for i in range(3):
            history.innovation[e, b + i] = innovation[0, i]
            history.innovation_sigma[e, b + i] = innovation[1, i]
        if nis > options.gate:
            history.verdict[e, kind] = REJECTED
            if kind != POSITION:
                continue
            if rejected_since == ABSENT:
                rejected_since = e
            if epochs.time[e] - epochs.time[rejected_since] < options.reset_after or nis == np.inf:
                continue
            reset_covariance(state.P, innovation[0], options.reset_after)
            history.verdict[e, kind] = COVARIANCE_RESET
        else:
            history.verdict[e, kind] = USED
            if nis > options.huber_threshold:
                R *= nis / options.huber_threshold
        if kind == POSITION:
            rejected_since = ABSENT
        cholesky3(R, L)
        forward_solve3(L, H)
        forward_solve3(L, nu)
        for i in range(3):
            history.H[e, b + i] = H[i, :wide]
            K = history.K[e, b + i]
            S, y = scalar_update(state.P, state.m, H[i], nu[i, 0], used, K, state.cross, track_cross)
            history.S[e, b + i] = S
            history.y[e, b + i] = y
    return rejected_since


@njit(cache=True)
def run_forward(intervals, epochs, model, earth, lever_b, nav0, x0, m0, P0, options, history):
    """Extended Kalman filter over the whole flight; see `FilterOptions` and `FilterHistory`.

    In closed loop the error estimate is fed back after every update, once psi is known better than the
    feedback threshold. Else the nominal at every epoch is the one that stands in `history` already
    (re-linearisation about an earlier result, K.6).
    """
    ns = model.channel.size
    n = N_NAV + ns
    work, epoch_work, triple = make_interval_work(ns), make_epoch_work(ns), make_triple(ns)
    state = FilterState(nav0.copy(), x0.copy(), m0.copy(), P0.copy(), np.zeros((N_NAV, n)))
    nav, x, m, P, cross = state.nav, state.x, state.m, state.P, state.cross
    closed_loop, threshold = options.closed_loop, options.feedback_threshold
    fed_back = False
    track_cross = False
    rejected_since = ABSENT
    for e in range(epochs.stop.size):
        if e > 0:
            predict(e, intervals, epochs, model, earth, closed_loop, fed_back, track_cross, state, work, epoch_work, history)
        if not closed_loop:
            nav[:] = history.nav[e]
            x[:] = history.x[e]
        rejected_since = update(e, epochs, model, earth, lever_b, options, track_cross, rejected_since, state, triple, epoch_work, history)
        fed_back = fed_back or max(P[AX, AX], P[AY, AY], P[AZ, AZ]) < threshold * threshold
        if closed_loop and fed_back:
            feed_back(nav, x, m)
        history.nav[e] = nav
        history.x[e] = x
        history.m[e] = m
        history.P[e] = P
        for k in range(n):
            history.sigma[e, k] = np.sqrt(P[k, k])
        if epochs.event[e] != ABSENT:
            history.cross[epochs.event[e]] = cross
            cross[:] = P[NAV]
            track_cross = True
