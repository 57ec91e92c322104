"""The filter's epochs from the fixes, and measurements that the vehicle's motion itself provides.

Where the recording shows what the vehicle does, its velocity is measured as zero (ZUPT, K.8), that
of a wheeled vehicle across its forward axis (NHC, K.9), and the mean gyro rate of a stationary
period as bias plus Earth rate (ZARU, K.10); see `navigation.filter.filter`.
"""

import numpy as np

from ...geodesy.frames import LocalFrame
from ...records import Array, GnssFixes, Increments
from ...records.qualities import Quality
from .codes import (
    ABOUT_STATES,
    ABSENT,
    FIXED_GROUP,
    N_CHANNELS,
    NHC,
    NO_CONSTRAINT,
    OF_STATES,
    UNFIXED_GROUP,
    ZUPT,
)
from .kernels.records import Epochs
from .layout import StateLayout

CODE_M = 0.5  # horizontal sigma that only code solutions have
FLOAT_S, CODE_S = 60.0, 600.0  # how long errors of float and of code solutions stay
# share of fixed and float solutions from which on the qualities are taken as they stand
LEAST_SHARE_OF_QUALITY = 0.1
ZUPT_INTERVAL_S = 1.0  # also the interval of the mean rates of a ZARU
ZUPT_SIGMA_MPS = 0.03  # what a standing vehicle sways
ZARU_SIGMA_RAD_S = 5e-5  # and turns
# of constraints (s): slips stay alike for about as long, and count once (chosen)
NHC_INTERVAL_S = 1.0
NHC_SIGMA_MPS = 0.3  # across the wheels: tyres slip, and mountings are a degree off
EPOCH_ROUNDING_S = 1e-6  # s, rounding of instants

NEARLY_ALL = 0.9  # of the code solutions of a recording, within a factor of 2.8 of the median


def make_epochs(
    inc: Increments,
    fix_index: np.ndarray,
    fixes: GnssFixes,
    event_index: np.ndarray,
    frame: LocalFrame,
) -> Epochs:
    """Return the epochs at the marks of the increments, with the fixes and camera events at them.

    Parameters
    ----------
    inc : Increments
        The increments, with m marks.
    fix_index : ndarray
        (k,) the mark of each fix.
    fixes : GnssFixes
        The k fixes; their velocities are measurements where they have them.
    event_index : ndarray
        (events,) the mark of each camera event.
    frame : LocalFrame
        The local frame l, into which positions, velocities and covariances are taken.

    Returns
    -------
    Epochs
        m epochs, without velocity constraints, ZARU, heights of a barometer and linearised rows.
    """
    m = inc.marks.size
    C_ln = frame.C_ln(fixes.lat, fixes.lon)
    has = np.zeros(m, dtype=np.bool_)
    has[fix_index] = True
    position, cov = np.zeros((m, 3)), np.zeros((m, 3, 3))
    position[fix_index] = frame.position_from_geodetic(fixes.lat, fixes.lon, fixes.height)
    cov[fix_index] = C_ln @ fixes.cov_ned @ np.swapaxes(C_ln, -1, -2)
    has_velocity, velocity, velocity_cov = (
        np.zeros(m, dtype=np.bool_),
        np.zeros((m, 3)),
        np.zeros((m, 3, 3)),
    )
    if fixes.velocity_ned is not None and fixes.velocity_cov_ned is not None:
        has_velocity[fix_index] = True
        velocity[fix_index] = np.einsum("nij,nj->ni", C_ln, fixes.velocity_ned)
        velocity_cov[fix_index] = C_ln @ fixes.velocity_cov_ned @ np.swapaxes(C_ln, -1, -2)
    group = np.full(m, FIXED_GROUP, dtype=np.int64)
    group[fix_index] = np.where(unfixed_solutions(fixes)[0], UNFIXED_GROUP, FIXED_GROUP)
    event = np.full(m, ABSENT, dtype=np.int64)
    event[event_index] = np.arange(event_index.size)
    return Epochs(
        stop=inc.stop,
        time=inc.marks - inc.marks[0],
        has_position=has,
        position=position,
        position_cov=cov,
        withheld=np.zeros(m, dtype=np.bool_),
        has_velocity=has_velocity,
        velocity=velocity,
        velocity_cov=velocity_cov,
        rate=inc.rate,
        temperature=np.zeros(m),
        event=event,
        sigma=_error_unit(cov, group),
        group=group,
        # writable: another type would have the kernels compiled anew
        gap=np.zeros((m, N_CHANNELS)) if inc.bridged is None else inc.bridged.copy(),
        bias_step=np.zeros((m, N_CHANNELS)),
        constraint=np.full(m, NO_CONSTRAINT, dtype=np.int64),
        constraint_cov=np.zeros((m, 3, 3)),
        zaru_rate=np.zeros((m, 3)),
        zaru_variance=np.zeros(m),
        barometer_height=np.zeros(m),
        barometer_variance=np.zeros(m),
        linear_H=np.zeros((m, 0, 3, OF_STATES)),
        linear_residual=np.zeros((m, 0, 3)),
        linear_cov=np.zeros((m, 0, 3, 3)),
        linear_about=np.zeros((m, ABOUT_STATES)),
    )


def _error_unit(cov: Array, group: np.ndarray) -> Array:
    """Return the standard deviations (m, 3) as the median times powers of two, zero without any.

    A time-correlated error that is counted in a sigma which goes up and down by a tenth could be
    told from the position by that alone. So could one of a code solution, whose white share is
    small, by a single fix that claims half of what the others do: where nearly all of them claim
    much the same, the median is the unit of every one.
    """
    sigma = np.sqrt(np.diagonal(cov, axis1=1, axis2=2))
    measured = sigma[:, 0] > 0.0
    out = np.zeros_like(sigma)
    if measured.any():
        middle = np.median(sigma[measured], axis=0)
        octave = np.rint(np.log2(sigma[measured] / middle))
        near = np.mean(np.abs(octave) <= 1.0, axis=0)
        if (group[measured] == UNFIXED_GROUP).all() and near.min() > NEARLY_ALL:
            octave[:] = 0.0
        out[measured] = middle * 2.0**octave
    return out


def unfixed_solutions(fixes: GnssFixes) -> tuple[np.ndarray, float]:
    """Return which fixes are float or code solutions, and how long the errors of these stay.

    Incorrect ambiguities stay until the geometry changes, a minute; the ionosphere of a code
    solution for ten and more. Where the qualities do not say it, the usual sigma decides for all
    fixes.

    Parameters
    ----------
    fixes : GnssFixes
        n fixes.

    Returns
    -------
    unfixed : ndarray
        (n,) bool.
    correlation_time_s : float
        Correlation time of their errors.
    """
    quality = fixes.quality
    if (
        quality is not None
        and np.isin(quality, (Quality.FIXED, Quality.FLOAT)).mean() >= LEAST_SHARE_OF_QUALITY
    ):
        unfixed = (Quality.FLOAT, Quality.SBAS, Quality.DGPS, Quality.SINGLE)
        return np.isin(quality, unfixed), FLOAT_S
    sigma = np.sqrt(0.5 * (fixes.cov_ned[:, 0, 0] + fixes.cov_ned[:, 1, 1]))
    return np.full(fixes.time.size, np.median(sigma) > CODE_M), CODE_S


def with_zupt(epochs: Epochs, inc: Increments, stationary: Array, layout: StateLayout) -> Epochs:
    """Return the epochs with ZUPT (K.8) and ZARU (K.10) once a second in stationary periods.

    Parameters
    ----------
    epochs : Epochs
        The epochs so far.
    inc : Increments
        The increments, whose sums are the mean rates of the ZARU.
    stationary : Array
        (k, 2) s, GPST, first and last instant of each stationary period.
    layout : StateLayout
        The layout, for the white noise of the gyros.

    Returns
    -------
    Epochs
        The epochs with these measurements besides.
    """
    constraint, cov = epochs.constraint.copy(), epochs.constraint_cov.copy()
    rate, variance = epochs.zaru_rate.copy(), epochs.zaru_variance.copy()
    between = np.add.reduceat(inc.dtheta, inc.stop[:-1])  # of each epoch to the next one
    turned = np.concatenate([np.zeros((1, 3)), np.cumsum(between, axis=0)])
    white = float(layout.white[:3].max())
    for begin, end in stationary:
        inside = np.flatnonzero((inc.marks >= begin) & (inc.marks <= end))
        before = -1
        for e in inside.tolist():
            if (
                before >= 0
                and inc.marks[e] - inc.marks[before] < ZUPT_INTERVAL_S - EPOCH_ROUNDING_S
            ):
                continue
            constraint[e], cov[e] = ZUPT, np.eye(3) * ZUPT_SIGMA_MPS**2
            if before >= 0:
                length = inc.marks[e] - inc.marks[before]
                rate[e] = (turned[e] - turned[before]) / length
                variance[e] = white / length + ZARU_SIGMA_RAD_S**2
            before = e
    return epochs._replace(
        constraint=constraint, constraint_cov=cov, zaru_rate=rate, zaru_variance=variance
    )


def with_barometer(epochs: Epochs, index: np.ndarray, height: Array, sigma_m: float) -> Epochs:
    """Return the epochs with heights of a barometer (K.12).

    Parameters
    ----------
    epochs : Epochs
        The epochs so far.
    index : ndarray
        (k,) the epoch of each height.
    height : Array
        (k,) m above the origin of l.
    sigma_m : float
        Standard deviation of their white error, m.

    Returns
    -------
    Epochs
        The epochs with these measurements besides.
    """
    above, variance = epochs.barometer_height.copy(), epochs.barometer_variance.copy()
    above[index], variance[index] = height, sigma_m**2
    return epochs._replace(barometer_height=above, barometer_variance=variance)


def with_nhc(epochs: Epochs) -> Epochs:
    """Return the epochs with NHC (K.9) once a second where nothing else is known of the velocity.

    Parameters
    ----------
    epochs : Epochs
        The epochs so far, ZUPT among them.

    Returns
    -------
    Epochs
        The epochs with these measurements besides.
    """
    step = max(1, round(NHC_INTERVAL_S / float(np.median(np.diff(epochs.time)))))
    due = np.zeros(epochs.constraint.size, dtype=np.bool_)
    due[::step] = True
    constraint = np.where(due & (epochs.constraint == NO_CONSTRAINT), NHC, epochs.constraint)
    across = np.diag([1.0, NHC_SIGMA_MPS**2, NHC_SIGMA_MPS**2])  # the forward row is empty
    cov = np.where((constraint == NHC)[:, None, None], across, epochs.constraint_cov)
    return epochs._replace(constraint=constraint, constraint_cov=cov)


def piece_of_epochs(epochs: Epochs, front: int, last: int) -> Epochs:
    """Return consecutive epochs.

    Parameters
    ----------
    epochs : Epochs
        All epochs.
    front, last : int
        The first of them, and the first behind them.

    Returns
    -------
    Epochs
        Views.
    """
    return Epochs(*(each[front:last] for each in epochs))


def numbered_within(event: np.ndarray, events: slice) -> np.ndarray:
    """Return numbers of events that count from the first of some.

    Parameters
    ----------
    event : ndarray of int
        (m,) number of the event of each epoch, or ABSENT.
    events : slice
        The events that are numbered.

    Returns
    -------
    ndarray of int
        (m,) from 0 on; ABSENT of all others.
    """
    inside = (event >= events.start) & (event < events.stop)
    return np.where(inside, event - events.start, ABSENT)
