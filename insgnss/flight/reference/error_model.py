"""The linear error model of the strapdown, and its transition and noise between two epochs.

The error states x_s add x_s u_s to the measured rate of one channel (gyro x y z, accelerometer
x y z): u_s is one for a bias, the time since the start for a drift, the measured rate of a channel
for a scale factor or a misalignment, and zero for the errors of the fixes. Let U (6, ns) hold the
u_s, each in the row of its channel. The measured rates r (6,) are corrected by U x; what is left
of the errors, U dx, and the white noise w move the navigation errors, with a = C_lb f:

    d(dp)/dt = dv                                                                  (T.6)
    d(dv)/dt = G dp - 2 Omega x dv - a x psi - C_lb (U dx + w)_accelerometers      (T.7)
    d(psi)/dt = -Omega x psi - C_lb (U dx + w)_gyros                               (T.8)
    d(dx)/dt = -beta dx + sqrt(drive) w_x                                          (T.9)

In one matrix, d(error)/dt = A error + noise of power spectral density W. Over a sample of length h,
A and W taken at its middle,

    Phi = I + A h + (A h)^2 / 2                                                    (T.10)
    Q = h/2 W + Phi (h/2 W) Phi'                                                   (T.11)

The first is the matrix exponential, the second Van Loan's integral by the trapezoidal rule, both
to second order in h. Samples follow each other by

    Phi_all <- Phi Phi_all,   Q_all <- Phi Q_all Phi' + Q                          (T.12)

Where the IMU did not sample and a bridge of the variance q (6,) stands in for its increments, the
channels have a constant error of variance q / T^2 over the interval T; M (n, 6) is what a constant
error of one makes of the navigation errors:

    M <- Phi M + h B,   Q_all <- Q_all + M diag(q) M' / T^2                        (T.13)

A step of a channel's constant bias adds its variance to that of the bias (T.14).

Groves (2013) 14.2; Van Loan (1978); Farrell (2008) 4.7.
"""

from dataclasses import dataclass

import numpy as np

from ...geodesy.rotation import skew
from ...navigation.filter.codes import BIAS, DRIFT_CODE, POS, PSI, TEMPERATURE_CODE, VEL
from ...navigation.filter.layout import StateLayout
from ...navigation.filter.problem import EstimationProblem
from ...records import Array
from .strapdown import GRAVITY_GRADIENT, NominalState, advance, gravity

# a longer sample (a bridged gap) is cut into pieces, so that (T.10, T.11) hold
LONGEST_SAMPLE_S = 0.01
GYRO_CHANNELS, ACCEL_CHANNELS = slice(0, 3), slice(3, 6)  # channels


@dataclass(frozen=True, eq=False)
class ReferenceInterval:
    """What lies between two epochs.

    Parameters
    ----------
    state : the nominal at the later epoch, propagated from the earlier one.
    Phi, Q : (n, n) transition and process noise of the error.
    """

    state: NominalState
    Phi: Array
    Q: Array


def earth_rate(problem: EstimationProblem) -> Array:
    """Return the Earth's rate (3,) in l, rad/s; read against time the Earth turns the other way."""
    return -problem.frame.earth_rate_l if problem.backward else problem.frame.earth_rate_l


def influence(layout: StateLayout, elapsed: float, temperature: float, rates: Array) -> Array:
    """Return U (6, ns), what one unit of each state adds to the measured rate of its channel.

    Parameters
    ----------
    layout : the states.
    elapsed : time since the problem's start, s.
    temperature : of the IMU above its mean, in its range.
    rates : (6,) measured rates of the channels, rad/s and m/s^2.
    """
    of_factor = np.zeros(10)  # that of AIDING_ERROR stays zero
    of_factor[:6], of_factor[BIAS], of_factor[DRIFT_CODE] = rates, 1.0, elapsed
    of_factor[TEMPERATURE_CODE] = temperature
    U = np.zeros((6, layout.size - 9))
    U[layout.channel, np.arange(layout.size - 9)] = of_factor[layout.factor]
    return U


def continuous(
    layout: StateLayout, C_lb: Array, force: Array, U: Array, Omega: Array, white: Array
) -> tuple[Array, Array, Array]:
    """Return A (n, n), W (n, n) and B (n, 6) of (T.6 to T.9).

    Parameters
    ----------
    layout : the states.
    C_lb : (3, 3) attitude.
    force : (3,) corrected specific force in body axes, m/s^2.
    U : (6, ns) of `influence`.
    Omega : (3,) rate of the Earth in l, rad/s.
    white : (6,) power spectral density of the channels' white noise.
    """
    n = layout.size
    A, W, B = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, 6))
    B[PSI, GYRO_CHANNELS], B[VEL, ACCEL_CHANNELS] = -C_lb, -C_lb
    A[POS, VEL] = np.eye(3)
    A[VEL, POS] = GRAVITY_GRADIENT
    A[VEL, VEL], A[PSI, PSI] = -2.0 * skew(Omega), -skew(Omega)
    A[VEL, PSI] = -skew(C_lb @ force)
    A[:9, 9:] = B[:9] @ U
    A[9:, 9:] = -np.diag(layout.beta)
    W[:9, :9] = (B[:9] * white) @ B[:9].T
    W[9:, 9:] = np.diag(layout.drive)
    return A, W, B


def propagate(problem: EstimationProblem, epoch: int, state: NominalState) -> ReferenceInterval:
    """Carry the nominal and its error model from the epoch before to `epoch`.

    Parameters
    ----------
    problem : the estimation problem.
    epoch : index of the later epoch, 1 or greater.
    state : the nominal at the epoch before, after its update.

    Returns
    -------
    ReferenceInterval
        Nominal at `epoch`, transition and process noise.
    """
    inc, epochs, layout = problem.inc, problem.epochs, problem.layout
    Omega, gravity_start, start = earth_rate(problem), gravity(problem.frame, state.p), state.p
    white = layout.white + 2.0 * layout.quantization**2 / problem.aiding_interval_s
    identity = np.eye(layout.size)
    Phi, Q, M = identity, np.zeros((layout.size,) * 2), np.zeros((layout.size, 6))
    elapsed = float(epochs.time[epoch - 1])
    last_two = epochs.time[epoch - 1 : epoch + 1], epochs.temperature[epoch - 1 : epoch + 1]
    for sample in range(epochs.stop[epoch - 1], epochs.stop[epoch]):
        pieces = max(1, int(np.ceil(inc.dt[sample] / LONGEST_SAMPLE_S - 1e-6)))
        step_s, rates = (
            inc.dt[sample] / pieces,
            np.concatenate([inc.dtheta[sample], inc.dvel[sample]]) / inc.dt[sample],
        )
        for _ in range(pieces):
            half_decay = np.exp(-0.5 * step_s * layout.beta)
            middle = elapsed + 0.5 * step_s
            U = influence(layout, middle, float(np.interp(middle, *last_two)), rates)
            corrected = rates - U @ (half_decay * state.x)
            gravity_now = gravity_start + GRAVITY_GRADIENT @ (state.p - start)
            advanced = advance(
                state,
                step_s * corrected[GYRO_CHANNELS],
                step_s * corrected[ACCEL_CHANNELS],
                step_s,
                gravity_now,
                Omega,
            )
            C_middle = 0.5 * (state.C_lb + advanced.C_lb)
            A, W, B = continuous(layout, C_middle, corrected[ACCEL_CHANNELS], U, Omega, white)
            F = identity + step_s * A + 0.5 * step_s**2 * (A @ A)  # (T.10)
            Q = F @ (Q + 0.5 * step_s * W) @ F.T + 0.5 * step_s * W  # (T.11, T.12)
            Phi, M = F @ Phi, F @ M + step_s * B
            state = NominalState(advanced.p, advanced.v, advanced.C_lb, half_decay**2 * state.x)
            elapsed += step_s
    gap_density = epochs.gap[epoch] / (epochs.time[epoch] - epochs.time[epoch - 1]) ** 2
    Q = Q + (M * gap_density) @ M.T  # (T.13)
    constant = np.flatnonzero((layout.factor == BIAS) & (layout.beta == 0.0))  # (T.14)
    Q[9 + constant, 9 + constant] += epochs.bias_step[epoch, layout.channel[constant]]
    return ReferenceInterval(state, Phi, Q)
