"""Error-state extended Kalman filter over a whole flight.

Measurement of the antenna position and velocity in l with the lever arm l_b from the IMU to the antenna phase centre:

    p_a = p + C_lb l_b                  dp_a = dp - [C_lb l_b x] psi                                     (K.1)
    v_a = v + C_lb (omega_lb x l_b)     dv_a = dv - [C_lb (omega_lb x l_b) x] psi + C_lb [l_b x] db_g     (K.2)

with omega_lb = gyro - bias - C_bl Omega. Where they are states (`layout.FixErrors`), the error of the lever arm, dl_b, adds C_lb dl_b to
dp_a and C_lb (omega_lb x dl_b) to dv_a; the time offset d of the fixes (a fix stamped t was taken at t + d,
d a constant or with a rate) makes them
p_a + v_a d + a d^2 / 2 and v_a + a d, with derivatives v_a + a d and a; the correlated error of the fixes, counted in standard
deviations of each (in steps of two), adds itself times these to the position.
Value and derivative leave one kernel together. A fix with covariance R = L L' is
whitened, z <- L^-1 z, H <- L^-1 H, and its three components are taken one after the other:

    S = h P h' + 1,  k = P h' / S,  m <- m + k (nu - h m),  P <- P - k S k'                              (K.4)

The update is taken as P - g g' with g = k sqrt(S), which keeps P symmetric to the bit; a scalar of unit variance takes away
h P h' / S < 1 of any direction's variance, and with a-priori to measurement variance ratios below 1e8 double precision keeps it
positive. Before the update the whole triple is tested: its normalised innovation squared (NIS) must not exceed the quantile of
chi-square with three degrees of freedom that belongs to `gate_sigma`; if it does the fix is left out, counted and reported. After the
update the estimate moves into the nominal (K.5) and m returns to zero.

As long as a component of psi is known to worse than one degree nothing is fed back: the estimate wanders within its wide covariance
(a heading on the ground, by degrees), and a nominal that followed it would be linearised about the excursion. The nominal stays the
inertial solution from the aligned start, m carries the estimate, and both are linear enough for each other.

When every fix of a second, and five of them at least, has been rejected, the filter rather than the fixes may be wrong (a wrong
ambiguity that lasted for seconds and let go again). The covariance is opened by the size of the innovation, d^2 for position,
(d / 1 s)^2 for velocity, the tilt that makes d in that time (at most a degree) for psi, and the fix is used (K.7). For the smoother
this is process noise like any other. It is counted and reported; more than three such reopenings and one every ten minutes are taken
as contradiction of the data.

Where the recording itself shows what the vehicle does (`prepare.still`), its velocity is measured as zero (K.8), that of a wheeled
vehicle across its forward axis (K.9), dv_b = C_bl (dv + v x psi), and the mean gyro rate of a stillness as bias plus Earth rate (K.10),
d(C_bl Omega) = C_bl (Omega x psi). These are tested like fixes, and left out where they fail. With `doubt` a triple whose NIS exceeds it
is taken with its covariance enlarged by NIS / doubt (K.11, Huber's weight), so that what is suspicious, yet below the gate, pulls less.

An interval that the IMU did not see (`Increments.bridged`) adds the covariance of what stands in for its increments (E.8).

Run about a given nominal (`closed` false) nothing is fed back; m follows m <- Phi m + (f(nominal before) - nominal), which makes
filter and smoother one Gauss-Newton step of the batch problem (K.6).
"""

from dataclasses import dataclass, replace

import numpy as np

from ..errors import DataError
from ..geodesy.frames import LocalFrame
from ..records import Array, GnssFixes, Increments
from ._kernels import Epochs, Store, run_forward
from .layout import StateLayout
from .strapdown import kernel_earth, kernel_segments

BLOCK_S = 0.05  # s, see error_model
HOLD_RAD = np.radians(1.0)  # psi must be known this well before anything is fed back
RESET_S, RESET_FIXES = 1.0, 4.5  # seconds and intervals of rejected fixes in a row, after which they are believed again
NOTHING, USED, REJECTED, REOPENED = 0, 1, 2, 3
POSITION, VELOCITY, MOTION, TURN = range(4)  # kinds of measured triples
KINDS = 4
STILL, WHEELS = 1, 2  # of Epochs.motion
CODE_M, FLOAT_S, CODE_S = 0.5, 60.0, 600.0  # horizontal sigma that only code solutions have; how long errors of float and code stay
REST_S, REST_MS, REST_RAD_S = 1.0, 0.03, 5e-5  # interval of the measurements at rest; what a standing vehicle sways and turns
WHEELS_S, WHEELS_MS = 1.0, 0.3  # likewise across the wheels: tyres slip, and mountings are a degree off


@dataclass(frozen=True)
class Problem:
    """Everything that one flight's estimation stands on.

    antenna_lever_b (3,) m, IMU to antenna phase centre in body axes.   gate : limit of the NIS of a triple.
    doubt : NIS beyond which a measurement is taken with a larger covariance (K.11).
    backward : the increments and fixes run against time (`align.initial`), so the Earth turns the other way.
    """

    inc: Increments
    epochs: Epochs
    frame: LocalFrame
    layout: StateLayout
    antenna_lever_b: Array
    gate: float
    aiding_interval_s: float
    backward: bool = False
    doubt: float = np.inf


@dataclass(frozen=True)
class Start:
    """State at the first epoch: nominal nav (10,) in l and x (ns,); a-priori mean (n,) about it and covariance P (n, n)."""

    nav: Array
    x: Array
    mean: Array
    P: Array


def part(problem: Problem, first: int, last: int) -> Problem:
    """The epochs first..last of a problem as a problem of their own, without camera events."""
    at = np.arange(first, last + 1)
    inc, s0, s1 = problem.inc, problem.epochs.stop[first], problem.epochs.stop[last]
    cut = Increments(
        inc.dt[s0:s1], inc.dtheta[s0:s1], inc.dvel[s0:s1], inc.marks[at], problem.epochs.stop[at] - s0, inc.rate[at], inc.nominal_s
    )
    return with_epochs(problem, at, cut)


def with_epochs(problem: Problem, at: np.ndarray, inc: Increments) -> Problem:
    """The problem with the epochs `at` of its own, which are the marks of `inc`, without camera events."""
    ep = problem.epochs
    taken = {name: getattr(ep, name)[at] for name in ep._fields if name not in ("stop", "time", "rate", "event")}
    event = np.full(at.size, -1, dtype=np.int64)
    epochs = ep._replace(stop=inc.stop, time=inc.marks - inc.marks[0], rate=inc.rate, event=event, **taken)
    return replace(problem, inc=inc, epochs=epochs)


def at_rest(epochs: Epochs, inc: Increments, stretches: Array, layout: StateLayout) -> Epochs:
    """The epochs with zero velocity (K.8) and zero rotation (K.10) measured once a second while the vehicle rests.

    stretches : (k, 2) s, GPST, first and last instant of each rest.
    """
    motion, cov = epochs.motion.copy(), epochs.motion_cov.copy()
    rate, var = epochs.still_rate.copy(), epochs.still_var.copy()
    turned = np.concatenate([np.zeros((1, 3)), np.cumsum(inc.dtheta, axis=0)])
    white = float(layout.white[:3].max())
    for begin, end in stretches:
        inside = np.flatnonzero((inc.marks >= begin) & (inc.marks <= end))
        before = -1
        for e in inside.tolist():
            if before >= 0 and inc.marks[e] - inc.marks[before] < REST_S - 1e-6:
                continue
            motion[e], cov[e] = STILL, np.eye(3) * REST_MS**2
            if before >= 0:
                length = inc.marks[e] - inc.marks[before]
                rate[e] = (turned[inc.stop[e]] - turned[inc.stop[before]]) / length
                var[e] = white / length + REST_RAD_S**2
            before = e
    return epochs._replace(motion=motion, motion_cov=cov, still_rate=rate, still_var=var)


def on_wheels(epochs: Epochs) -> Epochs:
    """The epochs with no velocity across the forward axis (K.9), where nothing else is known of the motion."""
    step = max(1, round(WHEELS_S / float(np.median(np.diff(epochs.time)))))
    at = np.zeros(epochs.motion.size, dtype=np.bool_)
    at[::step] = True
    motion = np.where(at & (epochs.motion == NOTHING), WHEELS, epochs.motion)
    cov = np.where((motion == WHEELS)[:, None, None], np.diag([1.0, WHEELS_MS**2, WHEELS_MS**2]), epochs.motion_cov)
    return epochs._replace(motion=motion, motion_cov=cov)


def gate_from_sigma(gate_sigma: float) -> float:
    """NIS limit for a triple whose exceedance is as rare as `gate_sigma` for one normal variable."""
    from scipy.special import chdtri, ndtr

    return float(chdtri(3, 2.0 * ndtr(-gate_sigma)))


def make_epochs(inc: Increments, fix_place: np.ndarray, fixes: GnssFixes, event_place: np.ndarray, frame: LocalFrame) -> Epochs:
    """Epochs at the marks of `inc`; fix_place, event_place: index of the mark of each fix and event."""
    m = inc.marks.size
    C_ln = frame.C_ln(fixes.lat, fixes.lon)
    has = np.zeros(m, dtype=np.bool_)
    has[fix_place] = True
    position, cov = np.zeros((m, 3)), np.zeros((m, 3, 3))
    position[fix_place] = frame.position_from_geodetic(fixes.lat, fixes.lon, fixes.height)
    cov[fix_place] = C_ln @ fixes.cov_ned @ np.swapaxes(C_ln, -1, -2)
    has_velocity, velocity, velocity_cov = np.zeros(m, dtype=np.bool_), np.zeros((m, 3)), np.zeros((m, 3, 3))
    if fixes.velocity_ned is not None and fixes.velocity_cov_ned is not None:
        has_velocity[fix_place] = True
        velocity[fix_place] = np.einsum("nij,nj->ni", C_ln, fixes.velocity_ned)
        velocity_cov[fix_place] = C_ln @ fixes.velocity_cov_ned @ np.swapaxes(C_ln, -1, -2)
    group = np.zeros(m, dtype=np.int64)
    group[fix_place] = lasting_errors(fixes)[0]
    event = np.full(m, -1, dtype=np.int64)
    event[event_place] = np.arange(event_place.size)
    return Epochs(
        stop=inc.stop,
        time=inc.marks - inc.marks[0],
        has_position=has,
        position=position,
        position_cov=cov,
        has_velocity=has_velocity,
        velocity=velocity,
        velocity_cov=velocity_cov,
        rate=inc.rate,
        event=event,
        sigma=_in_octaves(cov),
        group=group,
        gap=np.zeros((m, 6)) if inc.bridged is None else inc.bridged.copy(),  # writable: kernels are compiled once for all flights
        motion=np.zeros(m, dtype=np.int64),
        motion_cov=np.zeros((m, 3, 3)),
        still_rate=np.zeros((m, 3)),
        still_var=np.zeros(m),
    )


def _in_octaves(cov: Array) -> Array:
    """(m, 3) standard deviations as the median times powers of two, zero where there is none.

    An error that lasts, times a sigma that goes up and down by a tenth, would be told from the position by that alone.
    """
    sigma = np.sqrt(np.diagonal(cov, axis1=1, axis2=2))
    known = sigma[:, 0] > 0.0
    out = np.zeros_like(sigma)
    if known.any():
        middle = np.median(sigma[known], axis=0)
        out[known] = middle * 2.0 ** np.rint(np.log2(sigma[known] / middle))
    return out


def lasting_errors(fixes: GnssFixes) -> tuple[np.ndarray, float]:
    """(n,) bool, fixes whose errors stay: float and code by their quality, or by their sigma; and for how long they do, s.

    Wrong ambiguities stay until the geometry changes, a minute; the ionosphere of a code solution for ten and more.
    """
    if fixes.quality is not None and np.isin(fixes.quality, (1, 2)).mean() >= 0.1:
        return np.isin(fixes.quality, (2, 3, 4, 5)), FLOAT_S
    sigma = np.sqrt(0.5 * (fixes.cov_ned[:, 0, 0] + fixes.cov_ned[:, 1, 1]))
    return np.full(fixes.time.size, np.median(sigma) > CODE_M), CODE_S


def make_store(epochs: Epochs, layout: StateLayout) -> Store:
    """Room for the results of a forward pass; used again by every further pass.

    What the pass fills in any case is left unset: large unset arrays come in huge pages, which costs a tenth of touching zeroed ones.
    """
    m, n = epochs.stop.size, layout.size
    ns = n - 9
    slot, used = _slots(epochs, layout)
    nz = used.size
    events = int(epochs.event.max()) + 1 if m else 0
    return Store(
        nav=np.empty((m, 10)),
        x=np.empty((m, ns)),
        m=np.empty((m, n)),
        P=np.empty((m, n, n)),
        sigma=np.empty((m, n)),
        F=np.empty((m, 9, n)),
        D=np.empty((m, ns)),
        H=np.empty((m, nz, int(used.max()))),
        K=np.empty((m, nz, n)),
        S=np.zeros((m, nz)),
        y=np.zeros((m, nz)),
        innovation=np.full((m, nz), np.nan),
        innovation_sigma=np.full((m, nz), np.nan),
        nis=np.full((m, KINDS), np.nan),
        verdict=np.zeros((m, KINDS), dtype=np.int64),
        slot=slot,
        used=used,
        cross=np.empty((events, 9, n)),
    )


def _slots(epochs: Epochs, layout: StateLayout) -> tuple[np.ndarray, np.ndarray]:
    """First row of each kind of triple that the epochs hold, and the columns that each row uses."""
    there = (True, epochs.has_velocity.any(), (epochs.motion > 0).any(), (epochs.still_var > 0.0).any())
    wide = (layout.size if layout.of_fixes else 9, layout.size, 9, layout.size)
    slot = np.array([3 * sum(there[:kind]) if there[kind] else -1 for kind in range(KINDS)], dtype=np.int64)
    return slot, np.repeat([columns for kind, columns in enumerate(wide) if there[kind]], 3).astype(np.int64)


def run_filter(problem: Problem, start: Start, store: Store, closed: bool = True) -> None:
    """Forward pass into `store`. With `closed` false the nominal that `store` holds stays and is linearised about.

    Raises DataError where the solution does not follow the fixes.
    """
    imu = problem.layout.kernel_model(BLOCK_S, problem.aiding_interval_s)
    nav0, x0, m0 = start.nav.copy(), start.x.copy(), start.mean.copy()
    if not closed:
        m0 = _difference(start, store)
    run_forward(
        kernel_segments(problem.inc),
        problem.epochs,
        imu,
        kernel_earth(problem.frame, problem.backward),
        np.array(problem.antenna_lever_b, dtype=np.float64),
        nav0,
        x0,
        m0,
        np.ascontiguousarray(start.P),
        closed,
        problem.gate,
        problem.doubt,
        HOLD_RAD,
        max(RESET_S, RESET_FIXES * problem.aiding_interval_s),
        store,
    )
    _refuse_divergence(problem, store)


def _difference(start: Start, store: Store) -> Array:
    """A-priori mean about the nominal of the first epoch."""
    from ._kernels import state_difference

    out = np.zeros(store.m.shape[1])
    state_difference(start.nav, start.x, store.nav[0], store.x[0], out)
    return out + start.mean


def _refuse_divergence(problem: Problem, store: Store) -> None:
    """Refuse a run in which most fixes were rejected or the filter had to be reopened again and again, or numbers broke."""
    time = np.abs(problem.inc.marks)  # negative where the problem runs against time
    if not np.isfinite(store.sigma[-1]).all() or not np.isfinite(store.nav[-1]).all():
        bad = int(np.argmax(~(np.isfinite(store.sigma).all(axis=1) & np.isfinite(store.nav).all(axis=1))))
        raise DataError(f"the filter diverged at {time[bad]:.3f} s; check axes, units and lever arm with `insgnss inspect`")
    fixes = np.count_nonzero(store.verdict[:, 0] != NOTHING)
    rejected = np.count_nonzero(store.verdict[:, 0] == REJECTED)
    reopened = np.flatnonzero(store.verdict[:, 0] == REOPENED)
    minutes = problem.epochs.time[-1] / 60.0
    if reopened.size > 3 + minutes / 10.0 or rejected > 0.5 * fixes:
        at = reopened[0] if reopened.size else int(np.argmax(store.verdict[:, 0] == REJECTED))
        raise DataError(
            f"{rejected} of {fixes} GNSS fixes rejected, from {time[at]:.1f} s on (NIS {store.nis[at, 0]:.0f}, limit "
            f"{problem.gate:.0f}), filter reopened {reopened.size} times: inertial and GNSS data contradict each other; check axes, units, "
            "time scales, sigmas, lever arm and noise model with `insgnss inspect`"
        )
