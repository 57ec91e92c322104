"""The same flight with other tools, where they are installed: the filter of smsfusion, the batch of
gtsam.

    pip install gtsam smsfusion
    python benchmarks/bench_others.py [--minutes 3] [--repeats 3]

    insgnss     filter and smoother, 30 states, full covariance at epochs and exposures; and with
                its own alignment before
    smsfusion   AidedINS, forward only, 15 states, one Python call a sample, started at the truth
    gtsam       a node at every fix with CombinedImuFactor and GPSFactorArm between,
                Levenberg-Marquardt, started at the truth, 15 states a node, no covariance asked
                for; the integration of the samples is called from Python one by one

CPU microseconds a sample, and the errors of the IMU's position and of the attitude at the fixes
against the truth, first and last 10 s left out. The others model gravity and Earth rotation more
simply; the errors say that all three solve the flight.
"""

import argparse
import importlib.util
from collections.abc import Callable

import numpy as np
from common import Case, block_flight, median_cpu, one_thread

from insgnss.geodesy.rotation import (
    quaternion_from_rotation,
    rotation_from_quaternion,
    vector_from_rotation,
)
from insgnss.navigation.align.initial import initial_state
from insgnss.navigation.filter.problem import InitialState
from insgnss.navigation.filter.solution import solve
from insgnss.records import Array

GRAVITY = 9.8066  # m/s^2 at the site
GYRO_WHITE, ACCEL_WHITE = 5.2e-5, 5.1e-4  # navchip, rad/s/sqrt(Hz) and m/s^2/sqrt(Hz)
GYRO_TURN_ON, ACCEL_TURN_ON = 4.8e-4, 2.0e-2  # rad/s and m/s^2
GYRO_WANDER, ACCEL_WANDER = (
    3e-5,
    3e-4,
)  # rad/s/sqrt(s) and m/s^2/sqrt(s), in place of the Gauss-Markov processes


def main() -> None:
    one_thread()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=3.0)
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args()
    case = block_flight(options.minutes, start_in_air=True)
    start = initial_state(case.problem).start
    tools: dict[str, Callable[[Case], tuple[Array, Array]]] = {
        "insgnss": lambda case: run_insgnss(case, start),
        "with alignment": lambda case: run_insgnss(case, initial_state(case.problem).start),
        "smsfusion": run_smsfusion,
        "gtsam": run_gtsam,
    }
    print(
        f"{case.samples} samples, {case.at_fix.size} fixes; CPU us a sample (median of"
        f" {options.repeats}), position rms mm N E D, tilt and heading rms deg"
    )
    own = 0.0
    for name, run in tools.items():
        if name in ("smsfusion", "gtsam") and importlib.util.find_spec(name) is None:
            print(f"  {name:14} not installed")
            continue
        position, C_lb = run(case)
        p, tilt, heading = errors(case, position, C_lb)
        us = 1e6 * median_cpu(lambda run=run: run(case), options.repeats) / case.samples
        own = own or us
        print(
            f"  {name:14} {us:8.2f}   {p[0]:5.1f} {p[1]:5.1f} {p[2]:5.1f}   {tilt:.4f}"
            f" {heading:.3f}   {us / own:6.1f} times insgnss"
        )


def errors(case: Case, position: Array, C_lb: Array) -> tuple[Array, float, float]:
    """Rms of position (mm, N E D), tilt and heading (deg)."""
    p, _, C = case.truth()
    inside = slice(100, -100)
    psi = np.degrees(vector_from_rotation(C @ np.swapaxes(C_lb, 1, 2)))[inside]
    rms = np.sqrt(np.mean(psi**2, axis=0))
    return (
        1e3 * np.sqrt(np.mean((p - position)[inside] ** 2, axis=0)),
        float(np.hypot(*rms[:2]) / np.sqrt(2.0)),
        float(rms[2]),
    )


def run_insgnss(case: Case, start: InitialState) -> tuple[Array, Array]:
    """Filter and smoother."""
    solution = solve(case.problem, start)
    return solution.nav[case.at_fix, :3], rotation_from_quaternion(solution.nav[case.at_fix, 6:])


def samples(case: Case) -> tuple[Array, Array, np.ndarray]:
    """Gyro and accelerometer in body axes from the first fix on, and the number of samples before
    each fix.
    """
    imu = case.simulated.imu
    before = np.searchsorted(imu.time, case.marks[case.at_fix] + 1e-6)
    return (
        imu.gyro[before[0] :] @ case.C_b_imu.T,
        imu.accel[before[0] :] @ case.C_b_imu.T,
        before - before[0],
    )


def run_smsfusion(case: Case) -> tuple[Array, Array]:
    """Forward filter of smsfusion; the fixes come on samples in this flight."""
    import smsfusion

    gyro, accel, before = samples(case)
    p, v, C = case.truth()
    x0 = np.concatenate([p[0], v[0], quaternion_from_rotation(C[0]), np.zeros(6)])
    P0 = np.diag(np.repeat([1e-4, 1e-4, 1e-4, ACCEL_TURN_ON**2, GYRO_TURN_ON**2], 3))
    noise = (
        {"N": ACCEL_WHITE, "B": ACCEL_WANDER * 5, "tau_cb": 50.0},
        {"N": GYRO_WHITE, "B": GYRO_WANDER * 5, "tau_cb": 50.0},
    )
    rate, lever = 1.0 / case.problem.inc.nominal_s, case.problem.antenna_lever_b
    ins = smsfusion.AidedINS(
        rate, x0, P0, *noise, g=GRAVITY, lever_arm=lever, ignore_bias_acc=False, cold_start=False
    )
    fix = {
        int(s): case.problem.epochs.position[k] for s, k in zip(before, case.at_fix, strict=True)
    }
    variance = np.diag(case.problem.epochs.position_cov[0])
    position, quaternion = [], []
    for i in range(before[-1] + 1):
        at = fix.get(i)
        f, w = accel[min(i, len(accel) - 1)], gyro[min(i, len(gyro) - 1)]
        if at is None:
            ins.update(f, w)
        else:
            ins.update(f, w, pos=at, pos_var=variance)
            position.append(ins.position())
            quaternion.append(ins.quaternion())
    return np.array(position), rotation_from_quaternion(np.array(quaternion))


def run_gtsam(case: Case) -> tuple[Array, Array]:
    """Batch least squares of gtsam."""
    import gtsam
    from gtsam.symbol_shorthand import B, V, X

    gyro, accel, before = samples(case)
    p, v, C = case.truth()
    lever, dt = case.problem.antenna_lever_b, case.problem.inc.nominal_s
    parameters = gtsam.PreintegrationCombinedParams.MakeSharedD(GRAVITY)
    parameters.setGyroscopeCovariance(np.eye(3) * GYRO_WHITE**2)
    parameters.setAccelerometerCovariance(np.eye(3) * ACCEL_WHITE**2)
    parameters.setIntegrationCovariance(np.eye(3) * 1e-12)
    parameters.setBiasOmegaCovariance(np.eye(3) * GYRO_WANDER**2)
    parameters.setBiasAccCovariance(np.eye(3) * ACCEL_WANDER**2)
    parameters.setOmegaCoriolis(case.frame.earth_rate_l)
    zero = gtsam.imuBias.ConstantBias()
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    graph.addPriorConstantBias(
        B(0), zero, gtsam.noiseModel.Diagonal.Sigmas(np.repeat([ACCEL_TURN_ON, GYRO_TURN_ON], 3))
    )
    for k in range(before.size):
        R = gtsam.noiseModel.Gaussian.Covariance(case.problem.epochs.position_cov[case.at_fix[k]])
        graph.add(gtsam.GPSFactorArm(X(k), case.problem.epochs.position[case.at_fix[k]], lever, R))
        values.insert(X(k), gtsam.Pose3(gtsam.Rot3(C[k]), p[k]))
        values.insert(V(k), v[k])
        values.insert(B(k), zero)
        if k:
            pre = gtsam.PreintegratedCombinedMeasurements(parameters, zero)
            for i in range(before[k - 1], before[k]):
                pre.integrateMeasurement(accel[i], gyro[i], dt)
            graph.add(gtsam.CombinedImuFactor(X(k - 1), V(k - 1), X(k), V(k), B(k - 1), B(k), pre))
    result = gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()
    poses = [result.atPose3(X(k)) for k in range(before.size)]
    return np.array([pose.translation() for pose in poses]), np.array(
        [pose.rotation().matrix() for pose in poses]
    )


if __name__ == "__main__":
    main()
