"""Error-state extended Kalman filter over a whole flight.

Measurement of the antenna's position and velocity in l with the lever arm l_b from the IMU to the
antenna's phase centre:

    p_a = p + C_lb l_b                dp_a = dp - [C_lb l_b x] psi                            (K.1)
    v_a = v + C_lb (omega_lb x l_b)   dv_a = dv - [C_lb (omega_lb x l_b) x] psi
                                             + C_lb [l_b x] db_g                              (K.2)

with omega_lb = gyro - bias - C_bl Omega. Where they are states (`layout.FixErrors`), the error of
the lever arm, dl_b, adds C_lb dl_b to dp_a and C_lb (omega_lb x dl_b) to dv_a; the time offset d of
the fixes (a fix stamped t was taken at t + d, d a constant or with a rate) makes them p_a + v_a d +
a d^2 / 2 and v_a + a d, with derivatives v_a + a d and a; the time-correlated error of the fixes,
counted in standard deviations of each (in steps of two), adds itself times these to the position,
that of the velocities itself to the velocity.
Value and derivative leave one kernel together. A fix with covariance R = L L' is whitened, z <-
L^-1 z, H <- L^-1 H, and its three components are taken one after the other:

    S = h P h' + 1,  k = P h' / S,  m <- m + k (nu - h m),  P <- P - k S k'                   (K.4)

The update is taken as P - g g' with g = k sqrt(S), which keeps P symmetric to the bit; a scalar of
unit variance takes away h P h' / S < 1 of any direction's variance, and with a-priori to
measurement variance ratios below 1e8 double precision keeps it positive. Before the update the
whole triple is tested by the innovation gate: its normalised innovation squared (NIS) must not
exceed the quantile of chi-square with three degrees of freedom that belongs to `gate_sigma`; if it
does the fix is rejected, counted and reported. After the update the estimate moves into the nominal
(closed loop, K.5) and m returns to zero.

As long as a component of psi is known to worse than the feedback threshold of one degree nothing is
fed back: the estimate wanders within its wide covariance (a heading on the ground, by degrees), and
a nominal that followed it would be linearised about the excursion. The nominal stays the inertial
solution from the aligned start, m holds the estimate, and both are linear enough for each other.

When every fix of a second, and five of them at least, has been rejected, the filter rather than the
fixes may be wrong (an incorrect ambiguity fix that lasted for seconds and let go again). The
covariance is reset by the size of the innovation, d^2 for position, (d / 1 s)^2 for velocity, the
tilt that makes d in that time (at most a degree) for psi, and the fix is used (K.7). For the
smoother this is process noise like any other. It is counted and reported; more than three such
resets and one every ten minutes are taken as contradiction of the data.

Where the recording itself shows what the vehicle does (`navigation.prepare.stationarity`), its
velocity is measured as zero (zero-velocity update, ZUPT, K.8), that of a wheeled vehicle across its
forward axis (non-holonomic constraint, NHC, K.9), dv_b = C_bl (dv + v x psi), and the mean gyro
rate of a stationary period as bias plus Earth rate (zero angular rate update, ZARU, K.10), d(C_bl
Omega) = C_bl (Omega x psi). These are tested like fixes, and left out where they fail. A triple
whose NIS exceeds `huber_threshold` is taken with its covariance enlarged by NIS / threshold (K.11,
Huber's weight), so that what is suspicious, yet below the gate, pulls less.

A barometer measures the height h of the IMU above the origin of l, but for a bias that walks and a
scale factor of the air's temperature,

    z = b + (1 + s) h(p) + v          dz = (1 + s) u' dp + db + h ds                  (K.12)

with u, the ellipsoidal normal in l, as the gradient of h. The triple has this row alone, and its
other two are empty.

A measurement given by its prediction h alone (`records.measurements.Measurement`) enters linearised
about an earlier solution s0 (`linearised`), with H from differences of h there unless it is given:

    z - h(s0) = H (s - s0) + v                                                        (K.13)

Navigation, gyro biases and the measurement's own states stand in s. At first s0 is the nominal of a
filter without it. `solution.solve` linearises again about each result until that changes nothing.

An interval that the IMU did not see (`Increments.bridged`) adds the covariance of what stands in
for its increments (E.8).

Run in open loop about a given nominal nothing is fed back; m follows m <- Phi m + (f(nominal
before) - nominal), which makes filter and smoother one Gauss-Newton step of the batch problem
(K.6).
"""

import math

import numpy as np

from ...base.errors import DataError
from ...base.quantiles import chi_square_quantile
from ...records import Array
from .codes import (
    ABSENT,
    COVARIANCE_RESET,
    N_NAV,
    N_NOMINAL,
    NO_CONSTRAINT,
    NOT_MEASURED,
    POSITION_ROW,
    REJECTED,
)
from .kernels.forward import run_forward
from .kernels.records import (
    Earth,
    Epochs,
    FilterHistory,
    FilterState,
    ForwardOptions,
    IntegrationIntervals,
    StateModel,
)
from .kernels.update import state_difference
from .layout import StateLayout
from .problem import EstimationProblem, InitialState
from .strapdown import kernel_earth, kernel_intervals

INCREMENT_BLOCK_S = 0.05  # s, see error_model
FEEDBACK_RAD = np.radians(1.0)  # feedback threshold: psi must be known this well
# seconds and intervals of rejected fixes in a row before a reset
RESET_AFTER_S, RESET_FIXES = 1.0, 4.5
RESETS, MINUTES_PER_RESET = 3, 10.0  # covariance resets that are taken as the data's own
MOST_REJECTED_SHARE = 0.5  # share of the fixes
OUTAGE_S = 5.0  # between fixes, from which on the smoother needs the process noise (B.6)


def gate_from_sigma(gate_sigma: float, components: int = 3) -> float:
    """Return the NIS that is exceeded as rarely as `gate_sigma` by one normal variable.

    Parameters
    ----------
    gate_sigma : float
        Gate in standard deviations of one variable, two-sided.
    components : int
        Components that it measures.

    Returns
    -------
    float
        Quantile of chi-square with as many degrees of freedom.
    """
    return chi_square_quantile(components, math.erfc(gate_sigma / math.sqrt(2.0)))


def make_history(
    epochs: Epochs, layout: StateLayout, smoothed: bool = True, records: int | None = None
) -> FilterHistory:
    """Return room for the results of a forward pass; it is used again by every further pass.

    What the pass fills in any case is left unset: large unset arrays come in huge pages, which
    costs a tenth of touching zeroed ones.

    Parameters
    ----------
    epochs : Epochs
        The m epochs, for what they measure.
    layout : StateLayout
        The error states.
    smoothed : bool
        Whether a smoother is to follow; without it what only the smoother reads is kept of the last
        epoch alone. Touching new memory costs more than a pass of the filter.
    records : int, optional
        Of how many epochs it is kept else, where a smoother is to follow block by block.

    Returns
    -------
    FilterHistory
        Arrays of m epochs.
    """
    m = epochs.stop.size
    rows = min(m, 1) if not smoothed else m if records is None else records
    slot, used = measured_slots(epochs, layout)
    outage = outages(epochs) if smoothed else np.full(m, ABSENT, dtype=np.int64)
    noises = int(outage.max(initial=ABSENT)) + 1
    if noises and records is not None:
        noises = records
    exposed = np.flatnonzero(epochs.event != ABSENT)
    events = exposed.size
    if records is not None and records <= m:  # of a block, which holds that many epochs less one
        events = int(np.bincount(exposed // max(records - 1, 1)).max(initial=0))
    return history_room(m, layout.size, rows, slot, used, outage, noises, events)


def history_room(
    m: int,
    n: int,
    rows: int,
    slot: np.ndarray,
    used: np.ndarray,
    outage: np.ndarray,
    noises: int,
    events: int,
) -> FilterHistory:
    """Return room for m epochs of n states.

    Parameters
    ----------
    m, n : int
        Epochs and states.
    rows : int
        Rows of the records that the smoother alone reads.
    slot, used, outage : ndarray
        As in `FilterHistory`.
    noises : int
        Slots of the process noise in outages.
    events : int
        Camera events.

    Returns
    -------
    FilterHistory
        The arrays.
    """
    nz, ns = used.size, n - N_NAV
    return FilterHistory(
        nav=np.empty((m, N_NOMINAL)),
        x=np.empty((m, ns)),
        m=np.empty((rows, n)),
        P=np.empty((rows, n, n)),
        sigma=np.empty((m, N_NAV)),
        F=np.empty((rows, N_NAV, n)),
        D=np.empty((rows, ns)),
        H=np.empty((rows, nz, int(used.max()))),
        K=np.empty((rows, nz, n)),
        S=np.zeros((m, nz)),
        y=np.zeros((m, nz)),
        innovation=np.full((m, nz), np.nan),
        innovation_sigma=np.full((m, nz), np.nan),
        nis=np.full((m, slot.size), np.nan),
        verdict=np.full((m, slot.size), NOT_MEASURED, dtype=np.int64),
        slot=slot,
        used=used,
        cross=np.empty((events, N_NAV, n)),
        outage=outage,
        W=np.empty((noises, N_NAV, n)),
        Qbb=np.empty((noises, ns)),
    )


def outages(epochs: Epochs) -> np.ndarray:
    """Number the intervals that lie between two fixes far apart.

    Parameters
    ----------
    epochs : Epochs
        The m epochs.

    Returns
    -------
    ndarray
        (m,) of the interval before each epoch, or ABSENT.
    """
    m, fixes = epochs.stop.size, np.flatnonzero(epochs.has_position & ~epochs.withheld)
    number = np.full(m, ABSENT, dtype=np.int64)
    for k in np.flatnonzero(np.diff(epochs.time[fixes]) > OUTAGE_S):
        number[fixes[k] + 1 : fixes[k + 1] + 1] = 0
    within = number != ABSENT
    number[within] = np.arange(np.count_nonzero(within))
    return number


def measured_kinds(epochs: Epochs, layout: StateLayout) -> tuple[np.ndarray, np.ndarray]:
    """Return which kinds of triples the epochs hold, and on how many leading states each depends.

    Parameters
    ----------
    epochs : Epochs
        The epochs.
    layout : StateLayout
        The error states.

    Returns
    -------
    present : ndarray
        (kinds,) bool, position (always), velocity, velocity constraint, ZARU, barometer, and each
        linearised measurement (always).
    columns : ndarray
        (kinds,) int, columns of the derivative beyond which all are zero.
    """
    all_states = layout.size
    present_and_columns = (
        (True, all_states if layout.of_fixes else N_NAV),
        (epochs.has_velocity.any(), all_states),
        ((epochs.constraint != NO_CONSTRAINT).any(), N_NAV),
        ((epochs.zaru_variance > 0.0).any(), all_states),
        ((epochs.barometer_variance > 0.0).any(), all_states),
        *((True, all_states),) * epochs.linear_cov.shape[1],
    )
    present, columns = (np.array(of_kinds) for of_kinds in zip(*present_and_columns, strict=True))
    return present, columns


def measured_slots(epochs: Epochs, layout: StateLayout) -> tuple[np.ndarray, np.ndarray]:
    """Return where the triples of each kind stand.

    Parameters
    ----------
    epochs : Epochs
        The epochs.
    layout : StateLayout
        The error states.

    Returns
    -------
    slot, used : ndarray
        (kinds,) first row of each kind, and (nz,) columns that each row uses.
    """
    present, columns = measured_kinds(epochs, layout)
    slot = np.where(present, 3 * (np.cumsum(present) - 1), ABSENT).astype(np.int64)
    return slot, np.repeat(columns[present], 3).astype(np.int64)


def run_filter(
    problem: EstimationProblem,
    start: InitialState,
    history: FilterHistory,
    closed_loop: bool = True,
) -> None:
    """Run the forward pass.

    Parameters
    ----------
    problem : EstimationProblem
        What is measured, and how.
    start : InitialState
        The state at the first epoch.
    history : FilterHistory
        Takes the results. In open loop its nominal stays and is linearised about.
    closed_loop : bool
        Feed the error estimate back into the nominal state (K.5).

    Raises
    ------
    DataError
        Where the solution does not follow the fixes.
    """
    state = first_state(problem, start, history, closed_loop)
    run_forward(problem.epochs, state, history, 0, *forward_inputs(problem, closed_loop))
    refuse_divergence(problem, history)


def forward_inputs(
    problem: EstimationProblem, closed_loop: bool
) -> tuple[IntegrationIntervals, StateModel, Earth, Array, ForwardOptions]:
    """Return what the kernel takes besides epochs, state and history.

    Parameters
    ----------
    problem : EstimationProblem
        What is measured, and how.
    closed_loop : bool
        Feed the error estimate back into the nominal state (K.5).

    Returns
    -------
    tuple of IntegrationIntervals, StateModel, Earth, Array and ForwardOptions
        In the order of `kernels.forward.run_forward`; the array is the lever arm.
    """
    return (
        kernel_intervals(problem.inc),
        problem.layout.kernel_model(INCREMENT_BLOCK_S, problem.aiding_interval_s),
        kernel_earth(problem.frame, problem.backward),
        np.array(problem.antenna_lever_b, dtype=np.float64),
        ForwardOptions(
            closed_loop,
            float(FEEDBACK_RAD),
            problem.gates,
            float(problem.huber_threshold),
            float(max(RESET_AFTER_S, RESET_FIXES * problem.aiding_interval_s)),
        ),
    )


def first_state(
    problem: EstimationProblem, start: InitialState, history: FilterHistory, closed_loop: bool
) -> FilterState:
    """Return the filter before the first epoch.

    Parameters
    ----------
    problem : EstimationProblem
        What is measured, and how.
    start : InitialState
        The state at the first epoch.
    history : FilterHistory
        In open loop its nominal is linearised about.
    closed_loop : bool
        Feed the error estimate back into the nominal state (K.5).

    Returns
    -------
    FilterState
        Arrays of its own.
    """
    return FilterState(
        start.nav.copy(),
        start.x.copy(),
        start.mean.copy() if closed_loop else _difference(start, history),
        np.array(start.P, order="C"),
        np.zeros((N_NAV, problem.layout.size)),
        np.zeros(2, dtype=np.int64),
        np.array([np.nan, -1.0]),
    )


def _difference(start: InitialState, history: FilterHistory) -> Array:
    """Return the a-priori mean about the nominal of the first epoch."""
    out = np.zeros(start.mean.size)
    state_difference(start.nav, start.x, history.nav[0], history.x[0], out)
    return out + start.mean


def refuse_divergence(problem: EstimationProblem, history: FilterHistory) -> None:
    """Refuse a run that rejected most fixes, was reset again and again, or broke numerically.

    Parameters
    ----------
    problem : EstimationProblem
        What was filtered.
    history : FilterHistory
        What the pass left.

    Raises
    ------
    DataError
        Where the solution does not follow the fixes.
    """
    time = np.abs(problem.inc.marks)  # negative where the problem runs against time
    finite = np.isfinite(history.sigma).all(axis=1) & np.isfinite(history.nav).all(axis=1)
    if not finite[-1]:
        bad = int(np.argmax(~finite))
        raise DataError(
            f"the filter diverged at {time[bad]:.3f} s; check axes, units and lever arm with"
            " `insgnss inspect`"
        )
    verdict = history.verdict[:, POSITION_ROW]
    fixes = np.count_nonzero(verdict != NOT_MEASURED)
    rejected = np.flatnonzero(verdict == REJECTED)
    resets = np.flatnonzero(verdict == COVARIANCE_RESET)
    minutes = problem.epochs.time[-1] / 60.0
    if (
        resets.size > RESETS + minutes / MINUTES_PER_RESET
        or rejected.size > MOST_REJECTED_SHARE * fixes
    ):
        e = resets[0] if resets.size else rejected[0]
        raise DataError(
            f"{rejected.size} of {fixes} GNSS fixes rejected, from {time[e]:.1f} s on (NIS"
            f" {history.nis[e, POSITION_ROW]:.0f}, limit {problem.gate:.0f}), covariance reset"
            f" {resets.size} times: inertial and GNSS data contradict each other; check axes,"
            " units, time scales, sigmas, lever arm and noise model with `insgnss inspect`"
        )


def relabel_slots(outage: np.ndarray) -> np.ndarray:
    """Return slots of the process noise that are the rows of the epochs themselves.

    Parameters
    ----------
    outage : ndarray of int
        (m,) slot of each epoch, or ABSENT.

    Returns
    -------
    ndarray of int
        (m,) its row, or ABSENT.
    """
    return np.where(outage != ABSENT, np.arange(outage.size), ABSENT)
