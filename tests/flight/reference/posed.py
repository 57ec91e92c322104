"""Four seconds of a simulated flight in a turn, posed as an estimation problem with anything that
the state vector may hold.
"""

from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

import numpy as np
from flown import NO_GATE, Flown, fly, moved

from insgnss.flight.reference.linear import GaussianStates
from insgnss.navigation.filter.codes import NHC, ZUPT
from insgnss.navigation.filter.epochs import make_epochs
from insgnss.navigation.filter.layout import BarometerErrors, FixErrors, state_layout
from insgnss.navigation.filter.problem import EstimationProblem, InitialState, sub_problem
from insgnss.navigation.noise_model.model import AxisNoise, NoiseModel
from insgnss.navigation.prepare.clock import cut_fixes
from insgnss.navigation.prepare.gaps import edges
from insgnss.navigation.prepare.increments import body_increments, merge_marks

BEGIN_S, LENGTH_S = (
    10.0,
    4.0,
)  # of the flight, in the air: the end of a turn of 90 degrees and the line behind it
SIGMA = np.array([0.3, 0.3, 0.3, 0.2, 0.2, 0.2, *np.radians([0.3, 0.3, 0.8])])
OFFSET = np.array([0.1, -0.2, 0.1, 0.1, 0.1, -0.1, *np.radians([0.2, -0.1, 0.5])])
WHITE = (AxisNoise(white_noise=5e-5), AxisNoise(white_noise=5e-4))
GAP_S = (12.0, 12.35)
KNOWN = FixErrors()


@dataclass(frozen=True)
class Pose:
    """What is posed: noise of gyro and accelerometer, what is estimated besides, and what is
    measured.
    """

    gyro: AxisNoise = WHITE[0]
    accel: AxisNoise = WHITE[1]
    layout: dict[str, Any] = field(default_factory=dict)
    fixes: FixErrors = KNOWN
    motion: tuple[str, ...] = ()
    gap: bool = False
    problem: dict[str, Any] = field(default_factory=dict)
    displaced: tuple[int, int, float] | None = None  # first and last epoch, m
    withheld: tuple[int, int] | None = None  # first and last epoch
    heading_deg: float = 0.8
    barometer: BarometerErrors | None = None
    bias_step: int | None = None  # the epoch


@cache
def flown() -> Flown:
    return fly(BEGIN_S + LENGTH_S + 1.0, seed=5, imu_hz=100.0, velocity=True, gate=NO_GATE)


def posed(pose: Pose) -> tuple[EstimationProblem, InitialState]:
    """The problem, and a start that is OFFSET from the truth, with an a-priori mean that is not
    zero.
    """
    layout = state_layout(
        NoiseModel("posed", "made up", (pose.gyro,) * 3, (pose.accel,) * 3),
        fixes=pose.fixes,
        barometer=pose.barometer,
        **pose.layout,
    )
    problem = replace(_with_gap(flown()) if pose.gap else flown().problem, layout=layout)
    first, last = np.searchsorted(problem.epochs.time, [BEGIN_S - 1e-6, BEGIN_S + LENGTH_S])
    truth = flown().sim.flight.motion
    nav = _nav(truth, problem.inc.marks[first : first + 1])
    problem = sub_problem(problem, int(first), int(last))
    problem = replace(problem, epochs=_measured(problem, pose), **pose.problem)
    nav = moved(nav, -OFFSET[None] * _heading(pose))[0]
    P = np.diag(np.concatenate([SIGMA * _heading(pose), layout.sigma0]) ** 2)
    mean = 0.3 * np.sqrt(np.diag(P)) * np.cos(np.arange(layout.size))
    return problem, InitialState(nav, np.zeros(layout.size - 9), mean, P)


def _heading(pose: Pose) -> np.ndarray:
    return np.array([1.0] * 8 + [pose.heading_deg / 0.8])


def _nav(motion, time: np.ndarray) -> np.ndarray:
    from insgnss.geodesy.rotation import quaternion_from_rotation

    return np.hstack(
        [motion.position(time), motion.velocity(time), quaternion_from_rotation(motion.C_lb(time))]
    )


def _measured(problem: EstimationProblem, pose: Pose) -> Any:
    """The epochs with every third velocity left out, fixes of two groups, and what the pose
    adds.
    """
    ep = problem.epochs
    m = ep.time.size
    has_velocity, motion, still = ep.has_velocity.copy(), np.zeros(m, dtype=np.int64), np.zeros(m)
    has_velocity[::3] = False
    if "velocity" not in pose.motion:
        has_velocity[:] = False
    if "zero velocity" in pose.motion:
        motion[5::7] = ZUPT
    if "non-holonomic" in pose.motion:
        motion[3::7] = NHC
    if "zero rate" in pose.motion:
        still[4::6] = 1e-6
    position = ep.position.copy()
    if pose.displaced is not None:
        first, last, by = pose.displaced
        position[first : last + 1] += [by, -0.5 * by, 0.3 * by]
    withheld = ep.withheld.copy()
    if pose.withheld is not None:
        withheld[pose.withheld[0] : pose.withheld[1] + 1] = True
    cov = np.zeros((m, 3, 3))
    cov[motion == ZUPT] = np.diag([1.0, 0.4, 0.2])  # m^2/s^2: it does not stand still in fact
    cov[motion == NHC] = np.diag([1.0, 0.01, 0.02])
    rate = np.broadcast_to([1e-3, -2e-3, 1.5e-3], (m, 3)).copy()
    group = (np.arange(m) // 10) % 2
    height, height_variance = ep.barometer_height.copy(), ep.barometer_variance.copy()
    if pose.barometer is not None:
        height[2::3] = 0.7 - 1.05 * position[2::3, 2] + 0.02 * np.cos(np.arange(m)[2::3])
        height_variance[2::3] = 0.02**2
    step = ep.bias_step.copy()
    if pose.bias_step is not None:
        step[pose.bias_step] = [4e-5] * 3 + [4e-3] * 3  # of 0.36 deg/s and 6 mg
    return ep._replace(
        temperature=0.5 * np.sin(2.0 * ep.time),
        has_velocity=has_velocity,
        bias_step=step,
        constraint=motion,
        constraint_cov=cov,
        zaru_variance=still,
        zaru_rate=rate,
        group=group,
        position=position,
        withheld=withheld,
        barometer_height=height,
        barometer_variance=height_variance,
    )


def _with_gap(flown: Flown) -> EstimationProblem:
    """The flight's problem with the samples within GAP_S lost and bridged."""
    imu, start = flown.sim.imu, flown.sim.flight.motion.start
    keep = (imu.time < start + GAP_S[0]) | (imu.time > start + GAP_S[1])
    imu = replace(imu, time=imu.time[keep], gyro=imu.gyro[keep], accel=imu.accel[keep])
    fixes = cut_fixes(flown.sim.gnss, imu.time[0], imu.time[-1])
    marks, (at_fix, _) = merge_marks(fixes.time, edges(imu.time, fixes.time[0], fixes.time[-1]))
    inc = body_increments(imu, np.eye(3), marks)
    epochs = make_epochs(inc, at_fix, fixes, np.zeros(0, dtype=np.int64), flown.problem.frame)
    return replace(flown.problem, inc=inc, epochs=epochs)


def cross_covariance(states: GaussianStates, j: int, k: int) -> np.ndarray:
    """Return a smoother's covariance (n, n) of the error at epoch j with that at epoch k > j."""
    out = states.P[k]
    for i in range(k - 1, j - 1, -1):
        out = states.gain[i] @ out
    return out
