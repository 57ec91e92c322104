"""Measurements given by their prediction alone (K.13): against the twin, batch least squares and
the truth of simulated flights.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from air_motions import multirotor
from batch_least_squares import batch
from flown import NO_GATE, Flown, error_of, fly, start_near
from oracles import oracle
from scipy.stats import chi2
from shipped_sensors import OPTIONS

import insgnss
import insgnss.flight.config.imu_options  # registers the kind of option "axes"
from insgnss.base.errors import DataError, InputError
from insgnss.flight.reference.linear import factor_graph
from insgnss.flight.reference.twin import solve_twin
from insgnss.flight.reference.verify import differences
from insgnss.flight.sensors.kinds import kinds
from insgnss.flight.sensors.options import SHIPPED, MeasurementInput
from insgnss.geodesy.frames import LocalFrame
from insgnss.geodesy.rotation import rotation_from_quaternion
from insgnss.navigation.filter.codes import N_KINDS, NOT_MEASURED, REJECTED, USED
from insgnss.navigation.filter.layout import state_layout
from insgnss.navigation.filter.linearised import LINEAR_SIGMAS, linearised_about, with_measurements
from insgnss.navigation.filter.solution import solve
from insgnss.navigation.noise_model.model import load_noise_model
from insgnss.records.measurements import Measurement, Motion, OwnState
from insgnss.simulation.scenario import GnssOptions, ImuOptions, observe

SIGMA = np.array([0.5, 0.5, 0.5, 0.3, 0.3, 0.3, *np.radians([0.5, 0.5, 3.0])])
BEACON = np.array([40.0, -30.0, 5.0])  # m in l
TURN = 2.0 * np.pi


def heading(motion: Motion, states: np.ndarray) -> np.ndarray:
    return motion.roll_pitch_heading[:, 2] + states[:, 0]


def velocity(motion: Motion, states: np.ndarray) -> np.ndarray:
    return (1.0 + states[:, :1]) * motion.velocity_body


def distance(motion: Motion, states: np.ndarray) -> np.ndarray:
    return np.linalg.norm(motion.position - BEACON, axis=1) + states[:, 0]


def turning(motion: Motion, states: np.ndarray) -> np.ndarray:
    """Rate and bias of a gyro, which stand for all that depends on the biases."""
    return np.column_stack([motion.rate[:, 2], motion.gyro_bias[:, 2]])


KINDS = {
    "heading": (heading, 0.01, (OwnState("offset", 0.1, "rad"),), (0.04,), TURN),
    "velocity": (velocity, (0.1, 0.2, 0.3), (OwnState("scale", 0.05),), (0.03,), None),
    "distance": (distance, 0.2, (OwnState("bias", 1.0, "m", 0.0, 5.0),), (0.0,), None),
    "turning": (turning, (1e-3, 1e-3), (), (), None),
}


def measured(flown: Flown, kinds, rng: np.random.Generator) -> Flown:
    """The flight with measurements of the truth at its extra epochs."""
    at = flown.extra_epochs
    nav, time = flown.true_nav(at), flown.problem.inc.marks[at]
    C_lb, truth, frame = rotation_from_quaternion(nav[:, 6:]), flown.sim.truth, flown.problem.frame
    bias = truth.gyro_bias[np.searchsorted(truth.trajectory.time, time - 1e-6)]
    rate = flown.problem.inc.rate[at] - bias - np.einsum("kij,i->kj", C_lb, frame.earth_rate_l)
    motion = Motion(time, nav[:, :3], nav[:, 3:6], C_lb, rate, bias, frame)
    measurements = []
    for name, (predict, sigma, states, values, period) in kinds.items():
        exact = predict(motion, np.tile(np.array(values), (at.size, 1)))
        exact = exact.reshape(at.size, -1)
        noisy = exact + np.broadcast_to(sigma, exact.shape) * rng.standard_normal(exact.shape)
        measurements.append(Measurement(name, time, noisy, sigma, predict, states, 50.0, period))
    layout = state_layout(load_noise_model("navchip"), measurements=measurements)
    rows = [np.arange(at.size)] * len(kinds)
    problem = replace(flown.problem, layout=layout)
    return replace(flown, problem=with_measurements(problem, measurements, rows, [at] * len(kinds)))


def flown_with(kinds, seed: int, seconds: float, offset=None, every_s: float = 0.5):
    """Problem and start of a short flight with some kinds."""
    extra = np.arange(0.3, seconds - 0.5, every_s) + 0.0133
    flown = fly(seconds, seed, imu_hz=100.0, extra=extra, gate=NO_GATE)
    flown = measured(flown, kinds, np.random.default_rng(100 + seed))
    return flown, start_near(flown, SIGMA, offset)


def test_core_agrees_with_the_twin_and_with_batch_least_squares():
    """Oracle: the twin, which predicts at every state instead of reading rows, and the batch
    least-squares solution of its last linear problem by singular values, to 1e-3 sigma.
    """
    flown, start = flown_with(KINDS, 4, 1.5, 0.3 * SIGMA, 0.2)
    core = solve(flown.problem, start, "on")
    twin = solve_twin(flown.problem, start, core.passes + 1)
    assert max(d.in_sigmas for d in differences(core, twin)) < 1e-3
    assert max(abs(d.sigma_ratio) for d in differences(core, twin)) < 1e-3
    np.testing.assert_array_equal(core.verdict, twin.forward.decision)
    assert (core.verdict[:, N_KINDS:] == USED).sum() == len(KINDS) * flown.extra_epochs.size
    best = batch(twin.forward.linear)
    for k in range(0, core.time.size, 7):
        error = twin.smoothed.mean[k] - best.mean[k]
        assert np.abs(error / np.sqrt(np.diag(best.covariance(k, k)))).max() < 1e-3


@pytest.mark.slow
def test_twin_agrees_with_gtsam():
    """Oracle: GTSAM's elimination of the factor graph of the twin's last linear problem, to 1e-6
    sigma: its own factors of start, steps and measurements, no filter.
    """
    oracle("gtsam")
    flown, start = flown_with(KINDS, 4, 1.5, 0.3 * SIGMA, 0.2)
    core = solve(flown.problem, start, "on")
    twin = solve_twin(flown.problem, start, core.passes + 1)
    error = twin.smoothed.mean - factor_graph(twin.forward.linear)
    assert np.abs(error / np.sqrt(np.diagonal(twin.smoothed.P, axis1=1, axis2=2))).max() < 1e-6


def test_derivative_is_the_change_of_the_innovation():
    """Oracle: the exact nonlinear prediction at a state 0.1 sigma away, to second order."""
    flown, start = flown_with(KINDS, 4, 4.0)
    solution = solve(flown.problem, start)
    _, change = linearised_about(solution.problem, solution.nav, solution.x)
    assert change < LINEAR_SIGMAS
    states = len(flown.problem.layout.states)
    x = solution.x.copy()
    x[:, states - 1] += 0.5  # of the distance's bias, m, which is linear
    _, change = linearised_about(solution.problem, solution.nav, x)
    assert change < LINEAR_SIGMAS
    nav = solution.nav.copy()
    nav[:, 0] += 10.0  # of a distance of some 50 m, whose second derivative makes a metre
    _, change = linearised_about(solution.problem, nav, x)
    assert change > 1.0


def test_one_smoothed_pass_is_enough_where_the_filter_follows_the_fixes():
    """Oracle: the solution linearised about the smoothed flight, which the rows predict to a
    hundredth of a sigma; a flight whose attitude the filter does not know is smoothed first.
    """
    flown, far = flown_with({"heading": KINDS["heading"]}, 4, 8.0)
    start, steps = start_near(flown, 0.1 * SIGMA), list[str]()
    once = solve(flown.problem, start, progress=steps.append)
    assert steps == [
        "filter",
        "filter, with the sensors linearised about the solution without them",
        "smoother",
    ]
    again = solve(flown.problem, start, "on")
    assert (once.passes, again.passes) == (1, 2)
    sigma = np.sqrt(again.variance(np.arange(again.time.size)))
    assert np.abs(error_of(once.nav, again.nav) / sigma[:, :9]).max() < 0.05  # of (N.1)
    assert linearised_about(once.problem, again.nav, again.x)[1] < LINEAR_SIGMAS
    steps.clear()
    assert solve(flown.problem, far, progress=steps.append).passes == 2
    assert steps[1] == "filter, pass 2, linearised about the smoothed flight"


def test_a_derivative_that_is_given_is_that_of_differences():
    """Oracle: central differences of `predict` (of 1e-5 rad: to 1e-7), whose derivative by the
    place, 1e-7 rad/m, the shipped one leaves out; one of another shape is refused with both.
    """
    flown, start = flown_with({"heading": KINDS["heading"]}, 4, 4.0, 0.3 * SIGMA)
    options = MeasurementInput(kind="heading", file=Path("x"))
    predict, own, derivative = kinds()["heading"].model(options, ("heading",))
    solution, held = solve(flown.problem, start), flown.problem.measurements[0]

    def derivatives(**changes) -> np.ndarray:
        measurement = replace(held.measurement, predict=predict, states=own, **changes)
        posed = with_measurements(flown.problem, [measurement], [held.rows], [held.at_epoch])
        problem, _ = linearised_about(posed, solution.nav, solution.x)
        return problem.epochs.linear_H[held.at_epoch, 0]

    exact, differences = derivatives(derivative=derivative), derivatives()
    np.testing.assert_allclose(exact[:, :, 3:], differences[:, :, 3:], rtol=0.0, atol=1e-7)
    np.testing.assert_allclose(exact[:, :, :3], differences[:, :, :3], rtol=0.0, atol=4e-7)
    with pytest.raises(
        InputError, match=r"derivative returned shape \(7, 1, 12\), expected \(\d+, 1, 13"
    ):
        derivatives(derivative=lambda motion, states: np.zeros((motion.time.size, 12)))


def test_a_prediction_that_writes_to_the_motion_is_stopped():
    """Oracle: by hand: the motion is shared by all differences, so that numpy refuses to write."""

    def adding(motion: Motion, states: np.ndarray) -> np.ndarray:
        angles = motion.roll_pitch_heading
        angles[:, 2] += states[:, 0]
        return angles[:, 2]

    changed = {"heading": (adding, *KINDS["heading"][1:])}
    with pytest.raises(ValueError, match="read-only"):
        flown_with(changed, 4, 2.0)


def test_rows_hold_about_another_nominal():
    """Oracle: the solution that the rows were linearised about, which the closed loop filter, whose
    nominal goes elsewhere, must reach from the same rows but for what is not linear.
    """
    flown, start = flown_with(KINDS, 4, 8.0, 0.3 * SIGMA)
    expected = solve(flown.problem, start, "on")
    rows_only = replace(expected.problem, measurements=())
    found = solve(rows_only, start, "off")
    assert found.passes == 1
    sigma = np.sqrt(expected.variance(np.arange(expected.time.size)))
    assert np.abs(error_of(found.nav, expected.nav) / sigma[:, :9]).max() < 0.05
    assert np.abs((found.x - expected.x) / sigma[:, 9:]).max() < 0.05


SIGMAS = {"velocity": 0.2, "field": 0.4}  # m/s and uT; 0.01 rad or m of all others


def shipped(kind: str) -> tuple:
    """Prediction and own states of a shipped kind."""
    options = MeasurementInput(kind=kind, file=Path("x"), **OPTIONS.get(kind, {}))
    return kinds()[kind].model(options, tuple(kinds()[kind].values.split()))[:2]


def nees_of(kind: str, seed: int, exact: bool) -> tuple[float, float]:
    """NEES of nine smoothed errors in the middle, and of the states of a shipped kind of sensor,
    drawn from their a-priori sigmas, or absent where `exact`.
    """
    predict, own = shipped(kind)
    own = tuple(replace(state, walk=0.0) for state in own)  # what is drawn stays
    rng = np.random.default_rng(1000 + seed)
    drawn = rng.standard_normal(len(own)) * [state.sigma for state in own]
    period = TURN if kinds()[kind].unit == "angle" else None
    sigma = SIGMAS.get(kinds()[kind].unit, 0.01)
    sigmas = (sigma,) * len(kinds()[kind].values.split())
    sensor = (predict, sigmas, own, drawn, period)
    if exact:

        def known(motion: Motion, _: np.ndarray) -> np.ndarray:
            return predict(motion, np.zeros((motion.time.size, len(own))))

        sensor = (known, sigmas, (), (), period)
    flown, start = flown_with({kind: sensor}, seed, 20.0, rng.standard_normal(9) * SIGMA, 0.97)
    solution = solve(flown.problem, start)
    k = np.array([flown.extra_epochs[10]])
    nav, P = error_of(solution.nav[k], flown.true_nav(k))[0], solution.covariance(k)[0]
    nees = float(nav @ np.linalg.solve(P[:9, :9], nav))
    if exact:
        return nees, 0.0
    error = drawn - solution.x[k[0], -len(own) :]
    return nees, float(error @ np.linalg.solve(P[-len(own) :, -len(own) :], error))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [4, 5])
@pytest.mark.parametrize("kind", SHIPPED)
def test_a_shipped_kind_agrees_with_batch_least_squares(kind, seed):
    """Oracle: the batch least-squares solution of the twin's last linear problem by singular
    values, and its standard deviations, to 1e-3 of them. The passes end where another one moves
    no prediction by a hundredth of a sigma; a further one reaches the batch.
    """
    predict, states = shipped(kind)
    sigmas = (SIGMAS.get(kinds()[kind].unit, 0.01),) * len(kinds()[kind].values.split())
    period = TURN if kinds()[kind].unit == "angle" else None
    values = [0.3 * state.sigma for state in states]
    sensor = (predict, sigmas, states, values, period)
    flown, start = flown_with({kind: sensor}, seed, 1.5, 0.3 * SIGMA, 0.2)
    stopped = solve(flown.problem, start, "on")
    twin = solve_twin(flown.problem, start, stopped.passes + 1)
    core = solve(flown.problem, start, "off", about=stopped)
    assert max(d.in_sigmas for d in differences(core, twin)) < 1e-3
    assert max(abs(d.sigma_ratio) for d in differences(core, twin)) < 1e-3
    assert max(d.in_sigmas for d in differences(stopped, twin)) < 2.0 * LINEAR_SIGMAS
    best = batch(twin.forward.linear)
    for k in range(0, core.time.size, 7):
        sigma = np.sqrt(np.diag(best.covariance(k, k)))
        assert np.abs((twin.smoothed.mean[k] - best.mean[k]) / sigma).max() < 1e-3
        np.testing.assert_allclose(np.sqrt(np.diag(twin.smoothed.P[k])), sigma, rtol=1e-3)


@pytest.mark.parametrize("exact", [False, True], ids=["with states", "exact"])
@pytest.mark.parametrize("flights", [2, pytest.param(24, marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", SHIPPED)
def test_nees_lies_within_its_bounds(kind, flights, exact):
    """Oracle: chi-square with 9 degrees of freedom a flight, and one for each state of the sensor,
    two-sided 99 % bounds.
    """
    nees = np.array([nees_of(kind, seed, exact) for seed in range(flights)]).sum(axis=0)
    states = len(shipped(kind)[1])
    for total, freedom in zip(nees, (9, states), strict=True):
        low, high = chi2.ppf([0.005, 0.995], flights * freedom)
        assert low < total < high or (exact and freedom == states)


def test_a_wrong_value_is_left_out_and_the_rest_is_as_without_it():
    """Oracle: the solution of the same flight without that row."""
    flown, start = flown_with({"heading": KINDS["heading"]}, 6, 6.0)
    own = flown.problem.measurements[0]
    values = own.measurement.values.copy()
    values[5] += 1.0
    wrong = replace(own.measurement, values=values, gate_sigma=5.0)
    keep = np.flatnonzero(np.arange(values.size) != 5)
    found, expected = (
        solve(with_measurements(flown.problem, [wrong], [rows], [own.at_epoch[rows]]), start)
        for rows in (own.rows, keep)
    )
    verdict = found.verdict[own.at_epoch, N_KINDS]
    assert (np.flatnonzero(verdict == REJECTED) == 5).all()
    assert expected.verdict[own.at_epoch[5], N_KINDS] == NOT_MEASURED
    np.testing.assert_allclose(found.nav, expected.nav, rtol=0.0, atol=1e-9)


@pytest.mark.slow
def test_a_flight_on_arrays_finds_the_offset_of_a_compass():
    """Oracle: the offset put in, to four sigmas; the heading is better where it is known; an angle
    given in another turn is the same angle.
    """
    sim = insgnss.simulate("ign8", 0.7, imu_rate_hz=50.0, seed=3, start_in_air=True)
    truth, rng = sim.truth.trajectory, np.random.default_rng(1)
    rows = np.arange(20, len(truth.time) - 20, 8)
    C = truth.C_nb[rows]
    noisy = np.arctan2(C[:, 1, 0], C[:, 0, 0]) + 0.035 + 0.005 * rng.standard_normal(rows.size)
    states = (OwnState("offset", 0.1, "rad"),)

    def estimated(values, predict=heading, states=states):
        compass = Measurement(
            "compass", truth.time[rows], values, 0.005, predict, states, period=TURN
        )
        return insgnss.estimate(sim.imu, sim.gnss, mounting=sim.mounting, measurements=[compass])

    found = estimated(noisy)
    offset = next(e for e in found.states if e.state.group == "compass")
    assert abs(offset.value - 0.035) < 4.0 * offset.sigma
    assert offset.sigma < 0.2 * states[0].sigma
    exact = estimated(noisy - 0.035, lambda motion, _: motion.roll_pitch_heading[:, 2], ())
    middle = len(exact.trajectory) // 2
    assert exact.trajectory.cov[middle, 8, 8] < 0.5 * found.trajectory.cov[middle, 8, 8]
    check = next(c for c in found.checks if c.name == "measurements")
    assert f"compass: 0 of {rows.size} values rejected" in check.found
    assert 0.8 < float(check.found.split("scatter ")[1].split()[0]) < 1.25
    turned = estimated(noisy + TURN)
    np.testing.assert_allclose(turned.trajectory.rpy, found.trajectory.rpy, rtol=0, atol=1e-12)


@pytest.mark.slow
def test_a_hovering_copter_gets_its_heading_from_a_compass():
    """Oracle: refused without it (no motion, fixes of 0.5 m); with it the heading put in, to four
    sigmas, good to what is stated of the compass's own offset; nothing from a mere height.
    """
    hover = multirotor(0.55, "hover", seed=2)
    gnss = GnssOptions(sigma_m=(0.5, 0.5, 0.8))
    sim = observe(hover, 2, imu=ImuOptions(rate_hz=100.0, noise="consumer"), gnss=gnss)
    path = sim.truth.trajectory[5:-5:2]
    noisy = path.rpy[:, 2] + 0.005 * np.random.default_rng(1).standard_normal(len(path))
    states = (OwnState("offset", 0.02, "rad"),)
    compass = Measurement("compass", path.time, noisy, 0.005, heading, states, period=TURN)
    iron = {"declination_deg": 0.0, "hard_iron_sigma": 0.3, "soft_iron_sigma": 0.005}
    options = MeasurementInput(kind="magnetometer", file=Path("x"), **iron)
    predict, own = kinds()["magnetometer"].model(options, ("x", "y", "z"))
    zero = np.zeros((len(path), 3))
    exact = predict(
        Motion(
            path.time, zero, zero, path.C_nb, zero, zero, LocalFrame(path.lat[0], path.lon[0], 0.0)
        ),
        np.zeros((len(path), len(own))),
    )
    field = exact + 0.4 * np.random.default_rng(2).standard_normal(exact.shape)
    magnetometer = Measurement("magnetometer", path.time, field, 0.4, predict, own)
    level = Measurement("level", path.time, path.height, 0.5, lambda motion, _: motion.geodetic[2])

    def estimated(*measurements):
        return insgnss.estimate(
            sim.imu,
            sim.gnss,
            mounting=sim.mounting,
            noise="consumer",
            measurements=measurements,
        )

    for some in ((), (level,)):
        with pytest.raises(DataError, match="heading not observable"):
            estimated(*some)
    for sensor, least, most in ((compass, 0.015, 0.021), (magnetometer, 0.01, 0.03)):
        found = estimated(sensor).trajectory
        turn = found.C_nb[100] @ sim.truth.trajectory.at(found.time[100:101]).C_nb[0].T
        sigma = np.sqrt(found.cov[100, 8, 8])
        assert abs(turn[1, 0]) < 4.0 * sigma
        assert least < sigma < most


TIME = np.arange(3.0)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"time": TIME[::-1]}, "time must increase"),
        ({"values": np.ones((3, 4))}, "4 values at an instant, limit 3"),
        ({"values": np.ones(2)}, "expected"),
        ({"values": np.array([0.0, np.nan, 1.0])}, "time 1.0"),
        ({"sigma": 0.0}, "expected values above 0"),
        ({"sigma": np.ones((2, 2))}, "sigma has shape"),
        ({"sigma": np.zeros((3, 1, 1))}, "no positive covariance"),
        ({"name": ""}, "expected a text that names it"),
        ({"gate_sigma": -1.0}, "expected numbers above 0"),
        ({"period": 0.0}, "expected numbers above 0"),
    ],
)
def test_a_measurement_that_cannot_be_is_refused(change, said):
    """Oracle: the rule of each field, by hand."""
    right = {"name": "one", "time": TIME, "values": np.ones(3), "sigma": 1.0, "predict": heading}
    Measurement(**right)
    with pytest.raises(InputError, match=said):
        Measurement(**(right | change))


@pytest.mark.parametrize(
    "change",
    [
        {"sigma": 0.0},
        {"walk": -1.0},
        {"correlation_time_s": 0.0},
        {"sigma": np.inf},
        {"unit": "deg"},
    ],
)
def test_a_state_that_cannot_be_is_refused(change):
    """Oracle: the rule of each field, by hand."""
    with pytest.raises(InputError, match=r"expected|give its sigma in rad"):
        OwnState(**({"name": "bias", "sigma": 1.0} | change))


@pytest.mark.parametrize(
    ("wrong", "said"),
    [(np.ones((3, 2)), "returned shape"), (np.array([1.0, np.inf, 1.0]), "at 1.0")],
)
def test_a_prediction_that_cannot_be_is_refused(wrong, said):
    """Oracle: shape and finiteness, by hand."""
    measurement = Measurement("one", TIME, np.ones(3), 1.0, lambda motion, states: wrong)
    zero, eye = np.zeros((3, 3)), np.tile(np.eye(3), (3, 1, 1))
    motion = Motion(TIME, zero, zero, eye, zero, zero, None)
    with pytest.raises(InputError, match=said):
        measurement.predicted(motion, np.zeros((3, 0)))


def test_a_prediction_that_never_settles_is_refused():
    """Oracle: by hand: the fourth decimal of a heading, which any pass moves as it likes."""

    def digits(motion: Motion, states: np.ndarray) -> np.ndarray:
        return (1e4 * motion.roll_pitch_heading[:, 2]) % 1.0

    kinds = {"digits": (digits, 1e-3, (), (), None)}
    flown, start = flown_with(kinds, 3, 10.0)
    with pytest.raises(
        DataError, match=r"digits: after 6 filter passes .* check that `predict` is"
    ):
        solve(flown.problem, start)
