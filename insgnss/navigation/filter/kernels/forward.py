"""The filter (K.1-K.12) over all epochs: predict, measure, update."""

import numpy as np

from ....base.compilation import njit
from ..codes import (
    ABSENT,
    AX,
    AY,
    AZ,
    COVARIANCE_RESET,
    IMU0,
    N_KINDS,
    N_NAV,
    NOT_MEASURED,
    POSITION_ROW,
    REJECTED,
    USED,
    VEL0,
)
from .copies import copy_matrix, copy_vector
from .error_model import (
    add_bias_step,
    add_gap_noise,
    linearise,
)
from .error_states import course_from, set_decay
from .measurements import measured_triple
from .prediction import predict_covariance, propagate_mean
from .records import make_interval_work, make_triple
from .update import (
    cholesky,
    feed_back,
    forward_solve3,
    innovation_test,
    is_scalar,
    reset_covariance,
    scalar_update,
    state_difference,
    triple_update,
    weigh,
)


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def run_forward(epochs, state, history, begin, intervals, model, earth, lever_b, options):
    """Run the extended Kalman filter over the whole flight, or over a block of its epochs.

    In closed loop the error estimate is fed back after every update, once psi is known better than
    the feedback threshold, and the nominal is what the strapdown makes of it. Else the nominal at
    every epoch is the one that stands in `history` already (re-linearisation about an earlier
    result, K.6).

    One function, not three: a record that is handed to a function costs two atomic operations for
    each of its arrays, and with one call an epoch more the filter ran a tenth slower.

    Parameters
    ----------
    epochs : Epochs
        The m epochs of the filter.
    state : FilterState
        The filter after the epoch before `begin`, or a priori at the first epoch; taken on in place
        to the last epoch.
    history : FilterHistory
        What the forward pass leaves, filled in place.
    begin : int
        0 for the first epoch of the flight, which nothing is predicted to; else the first epoch of
        a block, one at least, with the last of the block before in front of it.
    intervals : IntegrationIntervals
        The body increments.
    model : StateModel
        The error states behind those of navigation.
    earth : Earth
        The local frame l.
    lever_b : ndarray
        (3,) from the IMU to the antenna's phase centre, body axes, m.
    options : ForwardOptions
        What the pass decides by.
    """
    closed_loop, reset_after = options.closed_loop, options.reset_after
    threshold = options.feedback_threshold
    ns = model.channel.size
    n = N_NAV + ns
    wide = history.H.shape[2]
    last_row = history.P.shape[0] - 1  # of what only the smoother reads
    nav, x, m, P, cross = state.nav, state.x, state.m, state.P, state.cross
    fed_back, track_cross = state.flags[0] != 0, state.flags[1] != 0
    rejected_since = state.times[0]
    work, triple = make_interval_work(ns), make_triple(ns)
    if state.times[1] > 0.0:
        set_decay(model, state.times[1], work)
    H, nu, R = triple.H, triple.nu, triple.R
    W, Qbb = np.zeros((1, N_NAV, n)), np.zeros((1, ns))
    X, nine = np.zeros((N_NAV, n)), np.zeros((N_NAV, N_NAV))
    scratch, gap, acceleration = np.zeros(n), np.zeros(n), np.zeros(3)
    L, S3, innovation = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((2, 3))
    HP, T = np.zeros((3, n)), np.zeros((3, N_NAV))
    for e in range(begin, epochs.stop.size):
        row = min(e, last_row)
        if e > 0:  # predict nominal, covariance, mean, cross-covariance
            if not closed_loop:
                copy_vector(history.nav[e - 1], nav)
                copy_vector(history.x[e - 1], x)
            F = history.F[row]
            D = history.D[row]
            for i in range(3):
                acceleration[i] = nav[VEL0 + i]
            first, last, course = epochs.stop[e - 1], epochs.stop[e], course_from(epochs, e - 1)
            linearise(intervals, first, last, course, nav, x, model, earth, F, D, W, Qbb, work)
            length = epochs.time[e] - course.elapsed
            for i in range(3):
                acceleration[i] = (nav[VEL0 + i] - acceleration[i]) / length
            if epochs.gap[e, 0] > 0.0:
                add_gap_noise(W[0], work.column, work.last_block[0], epochs.gap[e])
            if epochs.bias_step[e, 0] > 0.0:
                add_bias_step(Qbb[0], model, epochs.bias_step[e])
            if history.outage[e] != ABSENT:
                copy_matrix(W[0], history.W[history.outage[e]])
                copy_vector(Qbb[0], history.Qbb[history.outage[e]])
            predict_covariance(P, F, D, W[0], Qbb[0], X, nine)
            if closed_loop:
                gap[:] = 0.0
            else:
                state_difference(nav, x, history.nav[e], history.x[e], gap)
            if not (closed_loop and fed_back):  # else the mean is zero and stays so
                propagate_mean(F, D, m, gap, scratch)
            if track_cross:
                np.dot(cross, F.T, nine)
                for r in range(N_NAV):
                    for c in range(N_NAV):
                        cross[r, c] = nine[r, c]
                    for c in range(IMU0, n):
                        cross[r, c] *= D[c - IMU0]
        if not closed_loop:
            copy_vector(history.nav[e], nav)
            copy_vector(history.x[e], x)
        # Update, kind by kind. Velocity comes after position: its nominal is still the one before
        # feedback, m holds the rest.
        for kind in range(history.slot.size):
            history.verdict[e, kind] = NOT_MEASURED
            b = history.slot[kind]
            if b == ABSENT:
                continue
            if not measured_triple(
                kind, e, epochs, nav, x, lever_b, acceleration, model, earth, triple
            ):
                continue
            used = history.used[b]
            for i in range(3):
                history.S[e, b + i] = 0.0
            nis = innovation_test(P, H, nu, m, R, used, S3, L, HP, innovation)
            history.nis[e, kind] = nis
            for i in range(3):
                history.innovation[e, b + i] = innovation[0, i]
                history.innovation_sigma[e, b + i] = innovation[1, i]
            withheld = kind == POSITION_ROW and epochs.withheld[e]
            if nis > options.gate[kind] or withheld:
                history.verdict[e, kind] = REJECTED
                if kind != POSITION_ROW or withheld:
                    continue
                if np.isnan(rejected_since):
                    rejected_since = epochs.time[e]
                if epochs.time[e] - rejected_since < reset_after or nis == np.inf:
                    continue
                reset_covariance(P, innovation[0], reset_after)
                weigh(P, H, used, HP)
                history.verdict[e, kind] = COVARIANCE_RESET
            else:
                history.verdict[e, kind] = USED
                if nis > options.huber_threshold:
                    R *= nis / options.huber_threshold
            if kind == POSITION_ROW:
                rejected_since = np.nan
            cholesky(R, L)
            forward_solve3(L, H)
            forward_solve3(L, nu)
            forward_solve3(L, HP)
            for i in range(3):
                copy_vector(H[i, :wide], history.H[row, b + i])
            K, S, y = history.K[row, b : b + 3], history.S[e, b : b + 3], history.y[e, b : b + 3]
            if kind >= N_KINDS and is_scalar(H, used):
                scalar_update(P, m, H, HP, nu, used, K, S, y, cross, track_cross, T)
            else:
                triple_update(P, m, H, HP, nu, used, K, S, y, cross, track_cross, T)
        fed_back = fed_back or max(P[AX, AX], P[AY, AY], P[AZ, AZ]) < threshold * threshold
        if closed_loop and fed_back:
            feed_back(nav, x, m)
        copy_vector(nav, history.nav[e])
        copy_vector(x, history.x[e])
        copy_vector(m, history.m[row])
        copy_matrix(P, history.P[row])
        for k in range(N_NAV):
            history.sigma[e, k] = np.sqrt(P[k, k])
        if epochs.event[e] != ABSENT:
            copy_matrix(cross, history.cross[epochs.event[e]])
            copy_matrix(P[:N_NAV], cross)
            track_cross = True
    state.flags[0], state.flags[1] = fed_back, track_cross
    state.times[0], state.times[1] = rejected_since, work.last_block[0]
