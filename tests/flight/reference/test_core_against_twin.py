"""The compiled core against the reference twin: every measurement, every optional state, every
decision, each by itself.

Oracle of all: `insgnss.flight.reference`, which shares no kernel with the core and takes its
derivatives by central differences.
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from posed import Pose, cross_covariance, posed

from insgnss.flight.reference.twin import solve_twin
from insgnss.flight.reference.verify import differences
from insgnss.navigation.filter.codes import (
    COVARIANCE_RESET,
    NOT_MEASURED,
    POSITION_ROW,
    REJECTED,
    USED,
    VELOCITY_CONSTRAINT,
)
from insgnss.navigation.filter.filter import gate_from_sigma
from insgnss.navigation.filter.layout import BarometerErrors, FixErrors, SlowBias
from insgnss.navigation.filter.solution import solve
from insgnss.navigation.noise_model.model import AxisNoise, GaussMarkov

ALL = ("velocity", "zero velocity", "non-holonomic", "zero rate")
G, A = AxisNoise(white_noise=5e-5), AxisNoise(white_noise=5e-4)
EVERY_G = AxisNoise(
    5e-5, 1e-5, 5e-3, 1e-4, 1e-3, (GaussMarkov(2.5, 2e-3), GaussMarkov(72.0, 1e-3)), 3e-2, 3e-2
)
EVERY_A = AxisNoise(5e-4, 1e-4, 5e-2, 1e-3, 1e-2, (GaussMarkov(1.5, 2e-2),), 3e-2, 3e-2)
EVERY_FIX = FixErrors(0.3, None, None, (0.8, 0.7, 0.6), 5.0, (0.6, 0.6, 0.7), 1.0, 30.0, 0.4)
FIVE_SIGMA, TWO_SIGMA = gate_from_sigma(5.0), gate_from_sigma(2.0)
SCALE, MISALIGNMENT = {"scale_factor": True}, {"misalignment": True}

# Largest difference in sigmas. What the core leaves out within a block of 50 ms grows with the size
# of the errors, which are some hundred times those of a real sensor here so that four seconds
# determine them; a bridged gap is one block of 0.1 s.
TIGHT, USUAL, COARSE = 5e-4, 0.01, 0.06
RATIO = 0.15  # difference of the standard deviations, as a share of the tolerance


@dataclass(frozen=True)
class Case:
    """What is posed; the states whose sigma the data must halve in one at least, so that no two
    priors are compared; the tolerance.
    """

    pose: Pose
    determined: str = ""
    sigmas: float = TIGHT


def both(name: str) -> FixErrors:
    """Time-correlated errors of all fixes, or of the two groups."""
    return replace(EVERY_FIX, lever_arm_m=None, unfixed_gm_sigma=1.0 if name == "two" else None)


CASES = {
    "positions alone": Case(Pose()),
    "velocities": Case(Pose(motion=("velocity",))),
    "zero velocity": Case(Pose(motion=("zero velocity",))),
    "non-holonomic constraint": Case(Pose(motion=("non-holonomic",))),
    "zero angular rate": Case(Pose(replace(G, turn_on_bias=5e-3), motion=("zero rate",)), "gyro"),
    "bridged gap": Case(Pose(gap=True, motion=("velocity",)), sigmas=COARSE),
    "quantization": Case(Pose(replace(G, quantization=1e-4), replace(A, quantization=1e-3))),
    "turn-on bias": Case(
        Pose(replace(G, turn_on_bias=5e-3), replace(A, turn_on_bias=5e-2), motion=ALL),
        "bias",
        USUAL,
    ),
    "bias step": Case(
        Pose(
            replace(G, turn_on_bias=5e-3), replace(A, turn_on_bias=5e-2), motion=ALL, bias_step=20
        ),
        "bias",
        USUAL,
    ),
    "random walk": Case(
        Pose(
            replace(G, turn_on_bias=5e-3, random_walk=1e-3),
            replace(A, turn_on_bias=5e-2, random_walk=2e-2),
            motion=ALL,
        ),
        "bias",
        USUAL,
    ),
    "drift": Case(Pose(replace(G, drift=1e-3), replace(A, drift=2e-2), motion=ALL), "drift", USUAL),
    "bias by temperature": Case(
        Pose(layout={"slow": SlowBias("temperature")}, motion=ALL), "slow", USUAL
    ),
    "Gauss-Markov": Case(
        Pose(
            replace(G, gauss_markov=(GaussMarkov(1.0, 5e-3),)),
            replace(A, gauss_markov=(GaussMarkov(2.0, 0.1),)),
            motion=ALL,
        ),
        "GM",
        USUAL,
    ),
    "scale factor": Case(
        Pose(replace(G, scale_factor=0.05), replace(A, scale_factor=0.05), SCALE, motion=ALL),
        "scale",
        USUAL,
    ),
    "misalignment": Case(
        Pose(
            replace(G, misalignment=0.05), replace(A, misalignment=0.05), MISALIGNMENT, motion=ALL
        ),
        "from",
        USUAL,
    ),
    "lever arm": Case(Pose(fixes=FixErrors(lever_arm_m=0.3), motion=("velocity",)), "lever"),
    "time offset": Case(
        Pose(fixes=FixErrors(time_offset_s=0.1), motion=("velocity",)), "offset", USUAL
    ),
    "clock rate": Case(
        Pose(fixes=FixErrors(time_offset_s=0.1, clock_rate=0.01), motion=("velocity",)),
        "rate",
        USUAL,
    ),
    # the part of the offset in the position, d C (omega x l), turns with psi and grows with l
    "lever arm and time offset": Case(
        Pose(fixes=FixErrors(0.3, 0.03), motion=("velocity",)), "lever"
    ),
    "barometer": Case(Pose(barometer=BarometerErrors(2.0, 0.1, 0.1)), "barometer"),
    "time-correlated errors": Case(Pose(fixes=both("one")), ""),
    "errors of velocities": Case(
        Pose(
            fixes=FixErrors(
                velocity_gm_sigma_mps=0.3,
                velocity_correlation_time_s=2.0,
                velocity_white_scale=1.7,
            ),
            motion=("velocity",),
        ),
        "velocity",
    ),
    "two groups of fixes": Case(Pose(fixes=both("two")), "unfixed"),
    "everything but the clock": Case(
        Pose(
            *(EVERY_G, EVERY_A, SCALE | MISALIGNMENT, EVERY_FIX, ALL),
            gap=True,
            barometer=BarometerErrors(2.0, 0.1, 0.1),
        ),
        "unfixed",
        COARSE,
    ),
    "withheld fixes": Case(Pose(withheld=(12, 20), displaced=(12, 20, 0.5))),
    "gate": Case(Pose(problem={"gate": FIVE_SIGMA}, displaced=(12, 12, 3.0))),
    "robust weight": Case(
        Pose(problem={"gate": FIVE_SIGMA, "huber_threshold": TWO_SIGMA}, displaced=(12, 14, 0.08))
    ),
    "covariance reset": Case(
        Pose(motion=("velocity",), problem={"gate": FIVE_SIGMA}, displaced=(10, 40, 5.0))
    ),
    "feedback held back": Case(Pose(heading_deg=8.0, motion=("velocity",))),
    "read against time": Case(Pose(problem={"backward": True}, motion=("velocity",))),
}


@pytest.mark.parametrize("name", CASES)
def test_states_and_covariances_are_the_twins(name):
    """Oracle: the reference twin, one pass with feedback; every state at every epoch, and the
    gate's decisions.
    """
    case = CASES[name]
    problem, start = posed(case.pose)
    core, twin = solve(problem, start, "off", separations=0), solve_twin(problem, start)
    np.testing.assert_array_equal(core.verdict, twin.forward.decision)
    for found in differences(core, twin):
        assert found.in_sigmas < case.sigmas, found
        assert abs(found.sigma_ratio) < RATIO * case.sigmas, found
    sigma = np.sqrt(core.variance(np.arange(core.time.size))[:, 9:]).min(axis=0)
    states = map(str, problem.layout.states)
    named = [case.determined != "" and case.determined in state for state in states]
    assert not any(named) or (sigma / problem.layout.sigma0)[named].min() < 0.5


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("gate", {USED: 40, REJECTED: 1}),
        ("robust weight", {USED: 41}),
        ("covariance reset", {USED: 30, REJECTED: 10, COVARIANCE_RESET: 1}),
    ],
)
def test_the_twin_decides_as_was_planted(name, expected):
    """Oracle: the displaced fixes, counted by hand; a reset comes when a second of fixes at 10 Hz
    has been rejected.
    """
    problem, start = posed(CASES[name].pose)
    forward = solve_twin(problem, start).forward
    assert np.nanmax(forward.nis) > min(problem.huber_threshold, problem.gate)
    kinds, counts = np.unique(forward.decision[:, POSITION_ROW], return_counts=True)
    assert dict(zip(kinds.tolist(), counts.tolist(), strict=True)) == expected
    assert (forward.decision[:, VELOCITY_CONSTRAINT:] == NOT_MEASURED).all()


def test_a_second_pass_is_linearised_about_the_first():
    """Oracle: the core's second pass (K.6), from a start that the first pass leaves 0.1 sigma
    off.
    """
    problem, start = posed(CASES["velocities"].pose)
    core, twin = solve(problem, start, "on", separations=0), solve_twin(problem, start, 2)
    assert core.passes == 2
    assert max(found.in_sigmas for found in differences(core, twin)) < TIGHT
    first = differences(core, solve_twin(problem, start, 1))
    assert max(found.in_sigmas for found in first) > TIGHT


def test_cross_covariance_of_neighbouring_exposures_is_the_twins():
    """Oracle: products of the twin's smoother gains; as correlations."""
    problem, start = posed(CASES["turn-on bias"].pose)
    event = np.full(problem.epochs.time.size, -1, dtype=np.int64)
    event[[5, 12, 30]] = [0, 1, 2]
    problem = replace(problem, epochs=problem.epochs._replace(event=event))
    core, twin = solve(problem, start, "off", separations=0), solve_twin(problem, start)
    for number, (j, k) in enumerate(((5, 12), (12, 30)), start=1):
        expected = cross_covariance(twin.smoothed, j, k)[:9, :9]
        scale = np.sqrt(np.outer(*core.variance(np.array([j, k]))[:, :9]))
        assert (np.abs(core.event_cross[number] - expected) / scale).max() < 1e-3
        assert np.abs(expected / scale).max() > 0.3
