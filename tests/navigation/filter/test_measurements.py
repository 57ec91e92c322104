"""Value and Jacobian of the antenna's position and velocity."""

from dataclasses import replace

import numpy as np
import pytest
from flown import fly, moved, without_noise
from numba import typeof
from numpy.testing import assert_allclose

from insgnss.geodesy.earth import EARTH_RATE
from insgnss.geodesy.frames import LocalFrame
from insgnss.geodesy.rotation import rotation_from_quaternion
from insgnss.navigation.filter.codes import (
    BAROMETER_ROW,
    N_NAV,
    NAV,
    NHC,
    POSITION_ROW,
    PSI,
    VELOCITY_CONSTRAINT,
    VELOCITY_ROW,
    ZARU,
    ZUPT,
)
from insgnss.navigation.filter.epochs import make_epochs, with_zupt
from insgnss.navigation.filter.filter import INCREMENT_BLOCK_S
from insgnss.navigation.filter.kernels.measurements import measured_triple
from insgnss.navigation.filter.kernels.records import make_triple
from insgnss.navigation.filter.layout import BarometerErrors, FixErrors, state_layout
from insgnss.navigation.filter.strapdown import kernel_earth
from insgnss.navigation.noise_model.model import AxisNoise, GaussMarkov, NoiseModel
from insgnss.navigation.prepare.clock import cut_fixes
from insgnss.records import GnssFixes, Increments
from insgnss.simulation.sensors import antenna_states

LEVER = np.array([-0.4, 0.15, -0.3])
AXIS = AxisNoise(1e-4, 0.0, 1e-3, 0.0, 1e-5, (GaussMarkov(10.0, 1e-4),), 1e-2, 1e-2)
FIXES = FixErrors(lever_arm_m=0.3, time_offset_s=0.1, clock_rate=1e-4, gm_sigma=(0.5, 0.6, 0.7))
LAYOUT = state_layout(
    NoiseModel("all", "made up", (AXIS,) * 3, (AXIS,) * 3),
    scale_factor=True,
    misalignment=True,
    fixes=FIXES,
    barometer=BarometerErrors(2.0, 0.1, 0.05),
)
RATE = np.array([0.4, -0.3, 0.6])
ACCEL = np.array([1.5, -2.0, 0.5])
Z = np.array([3.0, -2.0, 1.0])
NAMES = [str(state) for state in LAYOUT.states]
OF_FIXES = np.array([9 + s for s, name in enumerate(NAMES) if "GNSS" in name or "lever" in name])


@pytest.fixture(scope="module")
def flown():
    return without_noise(fly(15.0, seed=2, layout=LAYOUT, velocity=True))


def rows(
    flown,
    nav,
    x,
    kind: int,
    elapsed: float = 7.0,
    rate=RATE,
    lever=LEVER,
    motion: int = ZUPT,
    accel=ACCEL,
):
    """Innovation (3,) against the measurement Z (of the antenna; zero of the motion) and its
    Jacobian (3, n).
    """
    one = np.ones(1, dtype=np.int64)
    ep = flown.problem.epochs._replace(
        time=np.array([elapsed]),
        rate=rate[None],
        has_position=one > 0,
        position=Z[None],
        has_velocity=one > 0,
        velocity=Z[None],
    )
    ep = ep._replace(
        group=0 * one,
        sigma=FIX_SIGMA[None],
        position_cov=np.diag(FIX_SIGMA**2)[None],
        velocity_cov=np.eye(3)[None],
    )
    ep = ep._replace(
        constraint=motion * one,
        constraint_cov=np.ones((1, 3, 3)),
        zaru_rate=rate[None],
        zaru_variance=np.ones(1),
        barometer_height=Z[2:],
        barometer_variance=np.ones(1),
    )
    triple = make_triple(LAYOUT.size - N_NAV)
    imu, earth = LAYOUT.kernel_model(INCREMENT_BLOCK_S, 0.1), kernel_earth(flown.problem.frame)
    assert measured_triple(kind, 0, ep, nav, x, lever, accel, imu, earth, triple)
    return triple.nu[:, 0].copy(), triple.H.copy()


FIX_SIGMA = np.array([0.02, 0.03, 0.05])


@pytest.mark.parametrize(
    ("kind", "motion"),
    [
        (POSITION_ROW, 0),
        (VELOCITY_ROW, 0),
        (VELOCITY_CONSTRAINT, ZUPT),
        (VELOCITY_CONSTRAINT, NHC),
        (ZARU, 0),
        (BAROMETER_ROW, 0),
    ],
)
def test_jacobian_is_the_derivative_of_its_own_value(flown, kind, motion):
    """Oracle: central differences; steps of 1e-4 leave 1e-9 of third order.

    (K.2) takes omega_lb as independent of psi, which leaves out Earth rate times lever arm, 4e-5
    m/s a radian. Through the time offset the position depends on psi and the gyros by omega x l d,
    less than a millimetre for the milliseconds that are left of d.
    """
    nav = flown.true_nav([100])
    x = 0.5 * LAYOUT.sigma0
    x[LAYOUT.offset] = 0.005
    _, H = rows(flown, nav[0], x, kind, motion=motion)
    # a height is good to 1e-9 m, of 6400 km, and bilinear but for the Earth's curvature
    step = 1.0 if kind == BAROMETER_ROW else 1e-4
    numeric = np.zeros_like(H)
    for s in range(LAYOUT.size):
        for sign in (1.0, -1.0):
            error = np.zeros(LAYOUT.size)
            error[s] = sign * step
            nu, _ = rows(flown, moved(nav, error[None, :9])[0], x + error[9:], kind, motion=motion)
            numeric[:, s] -= sign * nu / (2.0 * step)
    tight = np.ones(LAYOUT.size, dtype=bool)
    tight[PSI] = kind in (VELOCITY_CONSTRAINT, ZARU)
    if kind == POSITION_ROW:
        tight[9:] = False
        tight[OF_FIXES[3:]] = True
    assert_allclose(H[:, tight], numeric[:, tight], atol=1e-8)
    loose = (
        EARTH_RATE * np.linalg.norm(LEVER) if kind == VELOCITY_ROW else 0.005 * 7.0 * 0.5
    )  # a drift after 7 s, half a metre
    assert_allclose(H[:, ~tight], numeric[:, ~tight], atol=loose)
    assert np.abs(H[:, NAV]).max() > 0.1 or kind == ZARU
    assert (np.abs(H[:, 9:]).max() > 0.1) == (kind != VELOCITY_CONSTRAINT)


def test_fix_errors_enter_as_the_simulators_own(flown):
    """Oracle: exact motion of an antenna that is mounted 0.2 m further out and whose fixes are 40
    ms old, plus errors in sigmas.

    1 mm is the lever arm's own acceleration, omega^2 l d^2 / 2, and the jerk's d^3 / 6.
    """
    motion, lever = flown.sim.flight.motion, flown.problem.antenna_lever_b
    more, late, wrong = np.array([0.1, -0.2, 0.05]), -0.04, np.array([2.0, -1.0, 0.5])
    x = np.zeros(LAYOUT.size - 9)
    x[LAYOUT.lever : LAYOUT.lever + 3], x[LAYOUT.offset], x[LAYOUT.gm : LAYOUT.gm + 3] = (
        more,
        late,
        wrong,
    )
    for k in (30, 77, 120):
        t = flown.problem.inc.marks[k : k + 1]
        accel = (motion.velocity(t + 0.01) - motion.velocity(t - 0.01))[0] / 0.02
        given = {"rate": flown.problem.inc.rate[k], "lever": lever, "accel": accel}
        nu, _ = rows(flown, flown.true_nav([k])[0], x, POSITION_ROW, **given)
        assert_allclose(
            Z - nu,
            antenna_states(motion, lever + more, t + late)[0][0] + wrong * FIX_SIGMA,
            rtol=0.0,
            atol=1e-3,
        )
        nu, _ = rows(flown, flown.true_nav([k])[0], x, VELOCITY_ROW, **given)
        assert_allclose(
            Z - nu,
            antenna_states(motion, lever + more, t)[1][0] + accel * late,
            rtol=0.0,
            atol=1e-4,
        )


def test_a_barometer_measures_the_height_over_the_ellipsoid(flown):
    """Oracle: the geodetic heights of pyproj's ECEF positions, 5 km from the origin of l, where the
    ellipsoid lies 2 m below the plane; 1.02 times them and 3 m more.
    """
    pyproj = pytest.importorskip("pyproj")
    to_geodetic = pyproj.Transformer.from_crs("EPSG:4978", "EPSG:4979", always_xy=True)
    frame, nav = flown.problem.frame, flown.true_nav([100])[0]
    nav[:3] = [3000.0, -4000.0, -120.0]
    above = [
        to_geodetic.transform(*(frame.origin_ecef + frame.C_el @ p))[2]
        for p in (np.zeros(3), nav[:3])
    ]
    x = np.zeros(LAYOUT.size - 9)
    x[LAYOUT.barometer : LAYOUT.barometer + 2] = 3.0, 0.02
    nu, H = rows(flown, nav, x, BAROMETER_ROW)
    assert above[1] - above[0] == pytest.approx(122.0, abs=0.2)
    assert Z[2] - nu[0] == pytest.approx(3.0 + 1.02 * (above[1] - above[0]), abs=1e-6)
    assert (nu[1:] == 0.0).all()
    assert (H[1:] == 0.0).all()


def test_a_standing_vehicle_measures_its_gyro_bias_and_the_earth(flown):
    """Oracle: hand calculation, mean rate = bias + C_bl Omega, and velocity of a wheeled vehicle
    across its forward axis.
    """
    nav = flown.true_nav([60])[0]
    C = rotation_from_quaternion(nav[6:])
    x = np.zeros(LAYOUT.size - 9)
    x[NAMES.index("gyro y bias")] = 0.02
    nu, _ = rows(flown, nav, x, ZARU)
    assert_allclose(
        nu, RATE - [0.0, 0.02, 0.0] - C.T @ flown.problem.frame.earth_rate_l, rtol=0, atol=1e-15
    )
    assert_allclose(rows(flown, nav, x, VELOCITY_CONSTRAINT)[0], -nav[3:6], atol=0.0)
    across = rows(flown, nav, x, VELOCITY_CONSTRAINT, motion=NHC)[0]
    assert_allclose(across, [0.0, *-(C.T @ nav[3:6])[1:]], rtol=0, atol=1e-12)


def test_values_are_the_antennas(flown):
    """Oracle: exact motion of the antenna (rig of the simulator); 1e-4 m/s is the linear rate
    between samples times the lever arm.
    """
    motion, marks = flown.sim.flight.motion, flown.problem.inc.marks[20:130:5]
    lever = flown.problem.antenna_lever_b
    position, velocity = antenna_states(motion, lever, marks)
    truth, rate = flown.true_nav(slice(20, 130, 5)), flown.problem.inc.rate[20:130:5]
    zero = np.zeros(LAYOUT.size - 9)
    for k in range(marks.size):
        nu, _ = rows(flown, truth[k], zero, POSITION_ROW, lever=lever)
        assert_allclose(Z - nu, position[k], rtol=0.0, atol=1e-9)
        nu, _ = rows(flown, truth[k], zero, VELOCITY_ROW, rate=rate[k], lever=lever)
        assert_allclose(Z - nu, velocity[k], rtol=0.0, atol=1e-4)


def test_every_gyro_error_takes_its_share_of_the_rate(flown):
    """Oracle: hand calculation of omega = gyro - bias - drift t - M gyro, and the cross product
    with the lever arm.
    """
    x = np.zeros(LAYOUT.size - 9)
    errors = {
        "gyro x bias": 0.01,
        "gyro y drift": 0.002,
        "gyro z GM 1": -0.03,
        "gyro x scale factor": 0.05,
        "gyro z from x": 0.02,
        "accel x bias": 9.0,
    }
    for name, value in errors.items():
        x[NAMES.index(name)] = value
    nav = flown.true_nav([60])[0]
    C = rotation_from_quaternion(nav[6:])
    omega = (
        RATE
        - [0.01 + 0.05 * RATE[0], 0.002 * 7.0, -0.03 + 0.02 * RATE[0]]
        - C.T @ flown.problem.frame.earth_rate_l
    )
    nu, _ = rows(flown, nav, x, VELOCITY_ROW)
    assert_allclose(Z - nu, nav[3:6] + C @ np.cross(omega, LEVER), rtol=0.0, atol=1e-12)


def test_without_lever_arm_only_the_state_itself_is_seen(flown):
    """Oracle: identity."""
    nav = flown.true_nav([60])[0]
    for kind, column in ((POSITION_ROW, 0), (VELOCITY_ROW, 3)):
        x = 0.5 * LAYOUT.sigma0
        x[OF_FIXES - 9] = 0.0
        nu, H = rows(flown, nav, x, kind, lever=np.zeros(3))
        expected = np.zeros_like(H)
        expected[:, column : column + 3] = np.eye(3)
        assert_allclose(
            np.delete(H, OF_FIXES, axis=1), np.delete(expected, OF_FIXES, axis=1), atol=0.0
        )
        assert_allclose(nu, Z - nav[column : column + 3], rtol=1e-15)


def test_epochs_carry_measurements_to_the_local_frame(flown):
    """Oracle: fixes of the simulator against the exact antenna, normalised by the epoch's own
    covariance: chi-square of 3 a fix.
    """
    ep, motion = flown.problem.epochs, flown.sim.flight.motion
    at = np.flatnonzero(ep.has_position & ep.has_velocity)
    position, velocity = antenna_states(
        motion, flown.problem.antenna_lever_b, flown.problem.inc.marks[at]
    )
    for value, truth, cov in (
        (ep.position, position, ep.position_cov),
        (ep.velocity, velocity, ep.velocity_cov),
    ):
        error = value[at] - truth
        nis = np.einsum("ni,nij,nj->n", error, np.linalg.inv(cov[at]), error)
        assert abs(nis.mean() - 3.0) < 3.0 * np.sqrt(6.0 / at.size)
    assert_allclose(ep.position_cov[at[0]], np.diag([0.02, 0.02, 0.03]) ** 2, atol=1e-7)
    assert ep.time[0] == 0.0


def test_covariance_of_fixes_is_turned_into_the_local_frame():
    """Oracle: a standard deviation along the vertical of the fix, 200 km east of the origin, is one
    along that vertical in l.

    The verticals of the two points are 1.8 deg apart; position and velocity alike.
    """
    frame = LocalFrame(0.8, 0.1, 400.0)
    lat, lon = np.array([0.8]), np.array([0.1 + 200e3 / 6.38e6 / np.cos(0.8)])
    cov = np.diag([0.01, 0.01, 9.0])[None]
    fixes = GnssFixes(
        np.array([10.0]), lat, lon, np.array([400.0]), cov, np.array([[0.0, 0.0, 3.0]]), cov
    )
    inc = Increments(
        np.zeros(0),
        np.zeros((0, 3)),
        np.zeros((0, 3)),
        np.array([10.0]),
        np.zeros(1, dtype=np.int64),
        np.zeros((1, 3)),
        0.01,
    )
    got = make_epochs(inc, np.array([0]), fixes, np.zeros(0, dtype=np.int64), frame)
    above, below = (
        frame.position_from_geodetic(lat, lon, np.array([h]))[0] for h in (500.0, 300.0)
    )
    down = (below - above) / 200.0
    assert np.degrees(np.arccos(down[2])) > 1.2
    for P in (got.position_cov[0], got.velocity_cov[0]):
        assert_allclose(P @ down, 9.0 * down, rtol=0, atol=1e-9)
    assert_allclose(got.velocity[0], 3.0 * down, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("usual", "odd", "share", "unit"),
    [
        (2.0, 0.9, 0.01, 2.0),  # a code solution that claims half of the others: one unit
        (2.0, 0.2, 0.3, 0.25),  # many that claim far less are of another kind
        (0.02, 0.009, 0.01, 0.01),  # RTK: in steps of two, as before
    ],
)
def test_one_fix_of_another_sigma_does_not_tell_the_error_of_the_others(usual, odd, share, unit):
    """Oracle: the median, and powers of two of it."""
    n = 200
    sigma = np.where(np.arange(n) < share * n, odd, usual)
    cov = sigma[:, None, None] ** 2 * np.eye(3)
    lat = np.full(n, 0.8)
    fixes = GnssFixes(np.arange(n) * 1.0, lat, lat, np.zeros(n), cov)
    inc = Increments(
        np.zeros(0),
        np.zeros((0, 3)),
        np.zeros((0, 3)),
        fixes.time,
        np.zeros(n, dtype=np.int64),
        np.zeros((n, 3)),
        0.01,
    )
    frame = LocalFrame(0.8, 0.8, 0.0)
    got = make_epochs(inc, np.arange(n), fixes, np.zeros(0, dtype=np.int64), frame)
    assert_allclose(got.sigma[0], unit, rtol=1e-6)
    assert_allclose(got.sigma[-1], usual, rtol=1e-6)


def test_a_rest_measures_velocity_and_mean_rate_once_a_second():
    """Oracle: by hand, of epochs 0.8 s apart every other one.

    White noise of PSD q has the variance q / t in a mean over t, and the vehicle sways by 5e-5
    rad/s.
    """
    n, h, q = 60, 0.08, 1e-8
    axis = AxisNoise(white_noise=np.sqrt(q))
    layout = state_layout(NoiseModel("white", "made up", (axis,) * 3, (axis,) * 3))
    rate = np.array([1e-3, -2e-3, 3e-3])
    stop = np.arange(0, n + 1, 10)
    inc = Increments(
        np.full(n, h),
        np.tile(rate * h, (n, 1)),
        np.zeros((n, 3)),
        100.0 + stop * h,
        stop,
        np.zeros((7, 3)),
        h,
    )
    fixes = GnssFixes(
        inc.marks[:1], np.array([0.8]), np.array([0.1]), np.array([400.0]), np.eye(3)[None]
    )
    empty = make_epochs(
        inc, np.array([0]), fixes, np.zeros(0, dtype=np.int64), LocalFrame(0.8, 0.1, 400.0)
    )
    got = with_zupt(empty, inc, np.array([[100.4, 104.2]]), layout)
    assert got.constraint.tolist() == [0, ZUPT, 0, ZUPT, 0, ZUPT, 0]
    assert_allclose(got.constraint_cov[3], 0.03**2 * np.eye(3), rtol=1e-12)
    assert_allclose(
        got.zaru_variance, [0.0, 0.0, 0.0, q / 1.6 + 25e-10, 0.0, q / 1.6 + 25e-10, 0.0], rtol=1e-9
    )
    assert_allclose(got.zaru_rate[3], rate, rtol=1e-9)


def test_kernels_are_compiled_once_for_flights_with_and_without_gaps(flown):
    """Oracle: numba's types of the epochs; a read-only array makes another type, to be compiled."""
    inc = flown.problem.inc
    fixes = cut_fixes(flown.sim.gnss, inc.marks[0], inc.marks[-1])
    at_fix = np.flatnonzero(flown.problem.epochs.has_position)
    with_gap = replace(inc, bridged=np.full((inc.marks.size, 6), 1e-8))
    assert not with_gap.bridged.flags.writeable
    frame, events = flown.problem.frame, flown.event_epochs
    types = [typeof(make_epochs(one, at_fix, fixes, events, frame)) for one in (inc, with_gap)]
    assert types[0] == types[1]
