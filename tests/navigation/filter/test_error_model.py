"""Transition and process noise of an interval against differences of the nonlinear kernel and
against Van Loan's method.
"""

from dataclasses import replace

import numpy as np
import pytest
from filterpy.common import van_loan_discretization
from flown import Flown, fly, moved
from linearised_interval import Interval, linearise_interval
from numpy.testing import assert_allclose, assert_array_equal

from insgnss.geodesy.frames import LocalFrame
from insgnss.geodesy.rotation import rotation_from_quaternion, skew, vector_from_rotation
from insgnss.navigation.filter.codes import BIAS, DRIFT_CODE, NAV, POS, PSI, VEL
from insgnss.navigation.filter.filter import INCREMENT_BLOCK_S
from insgnss.navigation.filter.kernels.records import IntegrationIntervals
from insgnss.navigation.filter.kernels.update import state_difference
from insgnss.navigation.filter.layout import StateLayout, state_layout
from insgnss.navigation.filter.strapdown import kernel_earth, kernel_intervals
from insgnss.navigation.noise_model.model import AxisNoise, GaussMarkov, NoiseModel

GYRO = AxisNoise(
    5e-5, 0.0, 5e-4, 1e-6, 1e-6, (GaussMarkov(2.5, 8e-5), GaussMarkov(72.0, 2e-5)), 1e-3, 1e-3
)
ACCEL = AxisNoise(5e-4, 0.0, 2e-2, 1e-5, 1e-5, (GaussMarkov(1.5, 6e-4),), 1e-3, 1e-3)
EVERY_KIND = NoiseModel("every kind of state", "made up", (GYRO,) * 3, (ACCEL,) * 3)
LINE, TURN = 50, 120  # epochs of the flight below


@pytest.fixture(scope="module")
def layout() -> StateLayout:
    return state_layout(EVERY_KIND, scale_factor=True, misalignment=True)


@pytest.fixture(scope="module")
def flown(layout) -> Flown:
    """25 s at 500 Hz with an ideal IMU, so that the continuous model can be made of the exact
    motion.
    """
    return fly(25.0, seed=5, imu_hz=500.0, noise=None, layout=layout)


def interval(flown: Flown, epoch: int, nav, x, block_s: float) -> Interval:
    """The tenth of a second that follows an epoch."""
    p = flown.problem
    imu = p.layout.kernel_model(block_s, p.aiding_interval_s)
    first, last = p.inc.stop[epoch : epoch + 2]
    return linearise_interval(
        kernel_intervals(p.inc),
        first,
        last,
        nav,
        x,
        imu,
        kernel_earth(p.frame),
        p.epochs.time[epoch],
    )


def test_every_kind_of_state_is_there(layout):
    """Oracle: count by hand: per gyro bias, drift, two GM, scale factor, two misalignments; per
    accelerometer one GM less.
    """
    assert layout.size == 9 + 3 * 7 + 3 * 6
    assert set(layout.factor) == {BIAS, DRIFT_CODE, 0, 1, 2, 3, 4, 5}
    assert np.count_nonzero((layout.beta == 0.0) & (layout.drive > 0.0)) == 6
    assert np.count_nonzero(layout.beta > 0.0) == 9


def central_difference(flown: Flown, epoch: int, x, block_s: float, step) -> np.ndarray:
    """(n, n) derivative of the state at the interval's end with respect to that at its start,
    through the kernel itself.
    """
    n = step.size
    nav = flown.true_nav([epoch])
    base = interval(flown, epoch, nav[0], x, block_s)
    out = np.zeros((n, n))
    for s in range(n):
        for sign in (1.0, -1.0):
            error = np.zeros(n)
            error[s] = sign * step[s]
            end = interval(flown, epoch, moved(nav, error[None, :9])[0], x + error[9:], block_s)
            gap = np.zeros(n)
            state_difference(end.nav, end.x, base.nav, base.x, gap)
            out[:, s] += sign * gap / (2.0 * step[s])
    return out


@pytest.mark.parametrize("epoch", [LINE, TURN])
@pytest.mark.parametrize(("block_s", "finer"), [(INCREMENT_BLOCK_S, 1.0), (0.002, 0.02)])
def test_transition_is_the_derivative_of_the_nonlinear_kernel(flown, layout, epoch, block_s, finer):
    """Oracle: central differences about a state with all IMU errors present.

    Errors of 1 m, 0.1 m/s, 1e-4 rad and one sigma of each IMU state come out right to 0.1
    micrometres, 1e-6 m/s and 1e-7 rad a tenth of a second in the blocks of the filter (measured
    3e-8, 7e-8, 1.4e-9), and to a fiftieth of that in blocks of one sample: what is left out is of
    second order in the block.
    """
    x = 0.3 * layout.sigma0 * np.random.default_rng(1).standard_normal(layout.size - 9)
    step = np.concatenate([[1.0] * 3, [0.1] * 3, [1e-4] * 3, layout.sigma0])
    got = interval(flown, epoch, flown.true_nav([epoch])[0], x, block_s).Phi
    error = np.abs(got - central_difference(flown, epoch, x, block_s, step)) * step
    assert error[POS].max() < 1e-7 * max(finer, 0.02)
    assert error[VEL].max() < 1e-6 * finer
    assert error[PSI].max() < 1e-7 * finer
    assert (error[9:] / layout.sigma0[:, None]).max() < 1e-9


def test_transition_keeps_constants_and_lets_gauss_markov_decay(flown, layout):
    """Oracle: exp(-t/T), and one where there is no T; no IMU state sees another or the navigation.

    Blocks of lengths within 1e-10 s share one exponential: 1e-10 of it at most.
    """
    Phi = interval(
        flown, TURN, flown.true_nav([TURN])[0], np.zeros(layout.size - 9), INCREMENT_BLOCK_S
    ).Phi
    length = np.diff(flown.problem.inc.marks)[TURN]
    assert_allclose(np.diag(Phi)[9:], np.exp(-layout.beta * length), rtol=1e-10)
    off = Phi[9:] - np.diag(np.diag(Phi))[9:]
    assert_array_equal(off, 0.0)


def continuous(
    layout: StateLayout, earth_rate, C, rate, force, elapsed: float
) -> tuple[np.ndarray, np.ndarray]:
    """F (n, n) and G (n, 6 + ns) of (E.1) to (E.3) with unit white noise, assembled from the
    equations.
    """
    n = layout.size
    F, G = np.zeros((n, n)), np.zeros((n, 6 + n - 9))
    F[POS, VEL] = np.eye(3)
    F[VEL, POS] = np.diag([-1.0, -1.0, 2.0]) * 9.8 / 6.37e6
    F[VEL, VEL], F[VEL, PSI], F[PSI, PSI] = (
        -2.0 * skew(earth_rate),
        -skew(C @ force),
        -skew(earth_rate),
    )
    factor = {BIAS: 1.0, DRIFT_CODE: elapsed} | dict(enumerate([*rate, *force]))
    for s, (channel, kind) in enumerate(zip(layout.channel, layout.factor, strict=True)):
        F[PSI if channel < 3 else VEL, 9 + s] = -C[:, channel % 3] * factor[kind]
    F[9:, 9:] = np.diag(-layout.beta)
    G[PSI, :3], G[VEL, 3:6] = C * np.sqrt(layout.white[:3]), C * np.sqrt(layout.white[3:])
    G[9:, 6:] = np.diag(np.sqrt(layout.drive))
    return F, G


def van_loan(flown: Flown, epoch: int, pieces: int) -> tuple[np.ndarray, np.ndarray]:
    """Transition and noise of the interval after an epoch by Van Loan's method on the exact motion,
    piecewise constant.
    """
    p, motion = flown.problem, flown.sim.flight.motion
    t0, t1 = p.inc.marks[epoch : epoch + 2]
    h = (t1 - t0) / pieces
    Phi, Q = np.eye(p.layout.size), np.zeros((p.layout.size, p.layout.size))
    for k in range(pieces):
        t = t0 + (k + 0.5) * h
        rate, force = motion.inertial(t)
        F, G = continuous(
            p.layout,
            p.frame.earth_rate_l,
            motion.C_lb(t)[0],
            rate[0],
            force[0],
            p.epochs.time[epoch] + t - t0,
        )
        step, noise = van_loan_discretization(F, G, h)
        Phi, Q = step @ Phi, step @ Q @ step.T + noise
    return Phi, Q


@pytest.mark.parametrize("epoch", [LINE, TURN])
def test_transition_and_noise_are_van_loans(flown, layout, epoch):
    """Oracle: filterpy van_loan_discretization of the continuous model, fifty pieces to a tenth of
    a second.

    Variances to 5e-4 and correlations to 1e-2 in two blocks of 50 ms; to 2e-6 and 2e-5 in blocks of
    one sample.
    """
    Phi, Q = van_loan(flown, epoch, 50)
    nav, x = flown.true_nav([epoch])[0], np.zeros(layout.size - 9)
    sigma = np.sqrt(np.diag(Q))
    driven = sigma > 0.0
    scale = np.outer(sigma, sigma)[np.ix_(driven, driven)]
    size = np.concatenate([[1.0] * 3, [0.1] * 3, [1e-2] * 3, layout.sigma0])
    for block_s, variance, correlation in ((INCREMENT_BLOCK_S, 5e-4, 1e-2), (0.002, 2e-6, 2e-5)):
        got = interval(flown, epoch, nav, x, block_s)
        error = np.abs((got.Q - Q)[np.ix_(driven, driven)]) / scale
        assert np.diag(error).max() < variance
        assert error.max() < correlation
        assert_array_equal(got.Q[~driven], 0.0)
        assert (np.abs(got.Q - got.Q.T)[np.ix_(driven, driven)] / scale).max() < 1e-12
        # 1 m, 0.1 m/s, 0.01 rad and a sigma of each IMU state
        assert ((np.abs(got.Phi - Phi) * size)[POS] < 2e-7).all()
        assert ((np.abs(got.Phi - Phi) * size)[VEL] < 5e-7).all()
        assert ((np.abs(got.Phi - Phi) * size)[PSI] < 1e-8).all()


@pytest.mark.parametrize("epoch", [LINE, TURN])
def test_every_column_of_a_single_block_is_van_loans(flown, layout, epoch):
    """Oracle: filterpy van_loan_discretization; (E.4) and (E.5) over one block of 0.1 s, each three
    rows against their own size.

    Columns of navigation and of biases; those of scale factors go with rates that change within the
    block. Five per cent, with which a wrong factor in the smallest of them (position of a gyro
    bias, velocity of a height) does not hide behind greater ones; what is left out are terms of
    higher order in the block.
    """
    Phi, _ = van_loan(flown, epoch, 50)
    nav, x = flown.true_nav([epoch])[0], np.zeros(layout.size - 9)
    columns = np.concatenate([np.arange(9), 9 + np.flatnonzero(layout.factor == BIAS)])
    error = np.abs(interval(flown, epoch, nav, x, 0.1).Phi - Phi)[:, columns]
    for rows in (POS, VEL, PSI):
        size = np.abs(Phi[rows][:, columns]).max(axis=0)
        assert (error[rows].max(axis=0) <= 0.05 * size + 1e-12).all()


def test_bias_runs_linearly_over_a_block():
    """Oracle: closed form, integral of x exp(-t / T) over 0.1 s, for T of half a second.

    A body that only turns with the Earth, one gyro bias of 1 mrad/s on each axis. Two blocks of 50
    ms, over each of which the bias runs linearly, err by (B / T)^2 / 12, 0.08 %; held constant over
    a block it is 5 % off.
    """
    T, B, n = 0.5, INCREMENT_BLOCK_S, 20
    noisy = AxisNoise(gauss_markov=(GaussMarkov(T, 1e-3),))
    layout = state_layout(NoiseModel("one", "made up", (noisy,) * 3, (AxisNoise(),) * 3))
    frame = LocalFrame(0.8, 0.1, 400.0)
    h = 2.0 * B / n
    with_zupt = IntegrationIntervals(
        np.full(n, h), np.tile(frame.earth_rate_l * h, (n, 1)), np.zeros((n, 3))
    )
    level = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    imu, x = layout.kernel_model(B, 0.1), np.array([1e-3, -1e-3, 1e-3])
    got = linearise_interval(with_zupt, 0, n, level, x, imu, kernel_earth(frame), 0.0)
    turn = vector_from_rotation(rotation_from_quaternion(got.nav[6:]))
    assert_allclose(turn, -x * T * (1.0 - np.exp(-2.0 * B / T)), rtol=2e-3)


def test_a_drift_counts_the_time_since_the_start():
    """Oracle: closed form, a drift of rate d makes d t^2 / 2 in the first 0.1 s, of estimate and of
    its derivative.
    """
    layout = state_layout(
        NoiseModel("one", "made up", (AxisNoise(drift=1e-3),) * 3, (AxisNoise(),) * 3)
    )
    frame, n, h = LocalFrame(0.8, 0.1, 400.0), 20, 0.005
    with_zupt = IntegrationIntervals(
        np.full(n, h), np.tile(frame.earth_rate_l * h, (n, 1)), np.zeros((n, 3))
    )
    level = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    imu, x = layout.kernel_model(INCREMENT_BLOCK_S, 0.1), np.array([1e-3, -1e-3, 1e-3])
    got = linearise_interval(with_zupt, 0, n, level, x, imu, kernel_earth(frame), 0.0)
    assert_allclose(
        vector_from_rotation(rotation_from_quaternion(got.nav[6:])), -x * 0.005, rtol=1e-3
    )
    assert_allclose(np.diag(got.Phi[PSI, 9:]), -0.005, rtol=1e-3)


SILENT = AxisNoise()
ALONE = {
    "gyro white": (AxisNoise(white_noise=5e-5), SILENT),
    "accel white": (SILENT, AxisNoise(white_noise=5e-4)),
    "gyro walk": (AxisNoise(random_walk=1e-6), SILENT),
    "accel Gauss-Markov": (SILENT, AxisNoise(gauss_markov=(GaussMarkov(1.5, 6e-4),))),
}


@pytest.mark.parametrize(
    ("source", "block_s", "bound"),
    [
        ("gyro white", 0.1, 0.03),
        ("accel white", 0.1, 1e-4),
        ("gyro walk", 0.01, 0.02),
        ("accel Gauss-Markov", 0.01, 0.02),
    ],
)
def test_noise_of_one_source_alone_is_van_loans(flown, source, block_s, bound):
    """Oracle: filterpy van_loan_discretization, relative to the diagonal, so that no source hides
    behind a greater one.

    White noise in a single block; driving noise, of which (E.7) keeps the leading terms, in ten.
    Measured 0.024, 3e-6, 0.014, 0.007; a wrong factor in (E.7) shows as 0.2 and more.
    """
    gyro, accel = ALONE[source]
    layout = state_layout(NoiseModel(source, "one source", (gyro,) * 3, (accel,) * 3))
    alone = replace(flown, problem=replace(flown.problem, layout=layout))
    _, Q = van_loan(alone, LINE, 50)
    got = interval(alone, LINE, alone.true_nav([LINE])[0], np.zeros(layout.size - 9), block_s).Q
    seen = np.diag(Q) > 1e-12 * Q[:9, :9].max()
    sigma = np.sqrt(np.diag(Q))[seen]
    error = np.abs(got - Q)[np.ix_(seen, seen)] / np.outer(sigma, sigma)
    assert error.max() < bound


def test_noise_is_positive_semidefinite(flown, layout):
    """Oracle: eigenvalues of the correlation matrix; rounding leaves -1e-15, a wrong cross term
    would leave -1e-3.
    """
    Q = interval(
        flown, TURN, flown.true_nav([TURN])[0], np.zeros(layout.size - 9), INCREMENT_BLOCK_S
    ).Q
    driven = np.diag(Q) > 0.0
    sigma = np.sqrt(np.diag(Q))[driven]
    correlation = Q[np.ix_(driven, driven)] / np.outer(sigma, sigma)
    assert np.linalg.eigvalsh(correlation).min() > -1e-12


@pytest.mark.parametrize("epoch", [LINE, TURN])
def test_two_intervals_are_one(flown, layout, epoch):
    """Oracle: Chapman-Kolmogorov; the interval of two epochs has the transition and noise of the
    two that make it.
    """
    p = flown.problem
    nav, x = flown.true_nav([epoch])[0], 0.3 * layout.sigma0
    first = interval(flown, epoch, nav, x, INCREMENT_BLOCK_S)
    second = interval(flown, epoch + 1, first.nav, first.x, INCREMENT_BLOCK_S)
    imu = layout.kernel_model(INCREMENT_BLOCK_S, p.aiding_interval_s)
    span = p.inc.stop[epoch], p.inc.stop[epoch + 2]
    both = linearise_interval(
        kernel_intervals(p.inc), *span, nav, x, imu, kernel_earth(p.frame), p.epochs.time[epoch]
    )
    Q = second.Phi @ first.Q @ second.Phi.T + second.Q
    size = np.concatenate([[1.0] * 3, [0.1] * 3, [1e-2] * 3, layout.sigma0])
    assert_allclose((both.Phi - second.Phi @ first.Phi)[NAV] * size, 0.0, atol=1e-8)
    assert_allclose(both.nav, second.nav, rtol=0.0, atol=1e-9)
    driven = np.diag(Q) > 0.0
    scale = np.sqrt(np.outer(np.diag(Q), np.diag(Q)))[np.ix_(driven, driven)]
    assert (np.abs(both.Q - Q)[np.ix_(driven, driven)] / scale).max() < 1e-6
