"""The compiled core against the reference twin: every measurement, every optional state, every decision, each by itself.

Oracle of all: `insgnss.reference`, which shares no kernel with the core. Tolerances are those of the core's blocks of 50 ms against the
twin's samples of 10 ms: measured below 1e-3 sigma for most.
"""

from dataclasses import replace

import numpy as np
import pytest
from posed import Pose, posed

from insgnss.navigation.filter import NOTHING, POSITION, REJECTED, REOPENED, USED, gate_from_sigma
from insgnss.navigation.layout import FixErrors
from insgnss.navigation.solution import solve
from insgnss.reference.twin import solve_twin
from insgnss.reference.verify import differences
from insgnss.stochastic.model import AxisNoise, GaussMarkov

ALL_MOTION = ("velocity", "zero velocity", "non-holonomic", "zero rate")
G, A = AxisNoise(white_noise=5e-5), AxisNoise(white_noise=5e-4)
EVERY_G = AxisNoise(5e-5, 1e-5, 5e-3, 1e-4, 1e-3, (GaussMarkov(2.5, 2e-3), GaussMarkov(72.0, 1e-3)), 3e-2, 3e-2)
EVERY_A = AxisNoise(5e-4, 1e-4, 5e-2, 1e-3, 1e-2, (GaussMarkov(1.5, 2e-2),), 3e-2, 3e-2)
EVERY_FIX = FixErrors(0.3, None, None, (0.8, 0.7, 0.6), 5.0, (0.6, 0.6, 0.7), 1.0, 30.0, 0.4)
FIVE_SIGMA, TWO_SIGMA = gate_from_sigma(5.0), gate_from_sigma(2.0)

# what is posed; names of states that this must determine, so that it is no comparison of two priors
CASES = {
    "positions alone": (Pose(), ""),
    "velocities": (Pose(motion=("velocity",)), ""),
    "zero velocity": (Pose(motion=("zero velocity",)), ""),
    "non-holonomic constraint": (Pose(motion=("non-holonomic",)), ""),
    "zero angular rate": (Pose(replace(G, turn_on_bias=5e-3), motion=("zero rate",)), "gyro"),
    "bridged gap": (Pose(gap=True, motion=("velocity",)), ""),
    "quantization": (Pose(replace(G, quantization=1e-4), replace(A, quantization=1e-3)), ""),
    "turn-on bias": (Pose(replace(G, turn_on_bias=5e-3), replace(A, turn_on_bias=5e-2), motion=ALL_MOTION), "bias"),
    "random walk": (Pose(replace(G, turn_on_bias=5e-3, random_walk=1e-3), replace(A, turn_on_bias=5e-2, random_walk=2e-2), motion=ALL_MOTION), "bias"),
    "drift": (Pose(replace(G, drift=5e-3), replace(A, drift=0.2), motion=ALL_MOTION), "drift"),
    "Gauss-Markov": (Pose(replace(G, gauss_markov=(GaussMarkov(1.0, 1e-2),)), replace(A, gauss_markov=(GaussMarkov(0.5, 0.3),))), "GM"),
    "scale factor": (Pose(replace(G, scale_factor=0.05), replace(A, scale_factor=0.05), {"scale_factor": True}, motion=ALL_MOTION), "scale"),
    "misalignment": (Pose(replace(G, misalignment=0.05), replace(A, misalignment=0.05), {"misalignment": True}, motion=ALL_MOTION), "from"),
    "lever arm": (Pose(fixes=FixErrors(lever_arm_m=0.3), motion=("velocity",)), "lever"),
    "time offset": (Pose(fixes=FixErrors(time_offset_s=0.02), motion=("velocity",)), "offset"),
    "time offset and clock rate": (Pose(fixes=FixErrors(time_offset_s=0.02, clock_rate=0.01), motion=("velocity",)), "GNSS"),
    "time-correlated errors": (Pose(fixes=FixErrors(correlated=(3.0, 3.0, 3.0), correlation_time_s=2.0, scale=(0.5, 0.6, 0.7))), "GNSS"),
    "both time-correlated errors": (Pose(fixes=replace(EVERY_FIX, lever_arm_m=None)), "GNSS"),
    "everything but the clock": (
        Pose(EVERY_G, EVERY_A, {"scale_factor": True, "misalignment": True}, EVERY_FIX, ALL_MOTION, gap=True),
        "GM",
    ),
    "gate": (Pose(problem={"gate": FIVE_SIGMA}, displaced=(12, 12, 3.0)), ""),
    "robust weight": (Pose(problem={"gate": FIVE_SIGMA, "doubt": TWO_SIGMA}, displaced=(12, 14, 0.12)), ""),
    "covariance reset": (Pose(problem={"gate": FIVE_SIGMA}, displaced=(10, 40, 5.0)), ""),
    "feedback held back": (Pose(heading_deg=8.0, motion=("velocity",)), ""),
    "read against time": (Pose(problem={"backward": True}, motion=("velocity",)), ""),
}


@pytest.mark.parametrize("name", CASES)
def test_core_is_the_twin(name):
    pose, _ = CASES[name]
    problem, start = posed(pose)
    core = solve(problem, start, "off", separations=0)
    twin = solve_twin(problem, start)
    for d in differences(core, twin): print(name, d.quantity, f"{d.in_sigmas:.2e} {d.sigma_ratio:.2e}")
    np.testing.assert_array_equal(core.verdict, twin.forward.decision)
    s0 = problem.layout.sigma0; s = np.sqrt(np.diagonal(core.P,axis1=1,axis2=2))[:,9:].min(axis=0)/s0
    print(name, "OBS", dict(zip(problem.layout.names, s.round(2))))
    print(name, "VERDICT", [np.bincount(core.verdict[:,k], minlength=4).tolist() for k in range(4)])
