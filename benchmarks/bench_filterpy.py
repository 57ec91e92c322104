"""The same linear problem with filterpy: KalmanFilter in a Python loop, then its rts_smoother
method.

    python benchmarks/bench_filterpy.py [--seconds 60] [--repeats 5]

One piece of the bar's flight, linearised about the inertial solution that starts in the smoothed
state, so that transition Phi, noise Q and measurement H of every epoch are the same for both and no
offset remains. filterpy gets them ready made; insgnss works them out from the IMU samples on the
way, and that is in its time. Both return every state with its full covariance.

    at the epochs    filterpy with insgnss's Phi and Q from epoch to epoch; the results must be
                     equal
    at the samples   filterpy as it is used without such a kernel, a Phi and Q for every IMU sample
                     (also ready made), over the first tenth of the piece; the transition is cut
                     finer, so the results agree to a small part of a sigma
"""

import argparse
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
from common import Case, block_flight, median_cpu, one_thread
from filterpy.kalman import KalmanFilter

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from linearised_interval import Interval, linearise_interval

from insgnss.geodesy.rotation import rotation_from_quaternion, skew
from insgnss.navigation.align.initial import initial_state
from insgnss.navigation.filter.blocks import BlockwisePasses
from insgnss.navigation.filter.filter import INCREMENT_BLOCK_S
from insgnss.navigation.filter.problem import EstimationProblem, InitialState
from insgnss.navigation.filter.solution import Solution, solve
from insgnss.navigation.filter.strapdown import kernel_earth, kernel_intervals
from insgnss.records import Array, Increments

TOLERANCE = 1e-8


def main() -> None:
    one_thread()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--repeats", type=int, default=5)
    options = parser.parse_args()
    case = block_flight(8.0)
    whole = solve(case.problem, initial_state(case.problem).start)
    print("CPU, medians; all states with full covariance")
    problem, start = piece(case, whole, options.seconds)
    off = compare("at the epochs", problem, start, problem.inc.stop, options.repeats)
    assert off < TOLERANCE, f"the results differ by {off:.1e} (limit {TOLERANCE:g})"
    problem, start = piece(case, whole, options.seconds / 10.0)
    compare("at the samples", problem, start, np.arange(problem.inc.stop[-1] + 1), options.repeats)


def compare(
    name: str, problem: EstimationProblem, start: InitialState, stop: np.ndarray, repeats: int
) -> float:
    """Run and time both, filterpy with a step at each of `stop`; the greatest difference."""
    m = problem.epochs.stop.size
    passes = BlockwisePasses(problem, start, np.arange(m), 0, m)
    nominal, steps = linearised(problem, start, problem.inc.stop), linearised(problem, start, stop)
    nav, x = np.array([i.nav for i in nominal]), np.array([i.x for i in nominal])
    own_mean, own_cov = insgnss_run(passes, nav, x)
    own_mean, own_cov = own_mean.copy(), own_cov.copy()
    mean, cov = filterpy_run(problem, start, steps, stop)
    at = np.searchsorted(stop, problem.inc.stop)
    sigma = np.sqrt(np.diagonal(cov[at], axis1=1, axis2=2))
    off_mean = np.abs((own_mean - mean[at]) / sigma).max()
    off_cov = np.abs((own_cov - cov[at]) / (sigma[:, :, None] * sigma[:, None, :])).max()
    ours = median_cpu(lambda: insgnss_run(passes, nav, x), repeats)
    theirs = median_cpu(lambda: filterpy_run(problem, start, steps, stop), max(repeats // 2, 1))
    samples, epochs = problem.inc.dt.size, problem.inc.stop.size
    print(
        f"{name}: {samples} samples, {epochs} epochs, {problem.layout.size} states, {stop.size}"
        " steps of filterpy"
    )
    for who, seconds in (
        ("insgnss, linearisation included", ours),
        ("filterpy, Phi and Q given", theirs),
    ):
        print(
            f"  {who:33} {1e6 * seconds / epochs:9.1f} us an epoch {1e6 * seconds / samples:9.3f}"
            " us a sample"
        )
    print(
        f"  ratio {theirs / ours:.1f}; greatest difference in sigmas: means {off_mean:.1e},"
        f" covariances {off_cov:.1e}"
    )
    return float(max(off_mean, off_cov))


def piece(case: Case, whole: Solution, seconds: float) -> tuple[EstimationProblem, InitialState]:
    """The last `seconds` before the middle of a flight as a problem of its own, started in the
    smoothed state.
    """
    middle = case.marks.size // 2
    at = np.arange(int(np.searchsorted(case.marks, case.marks[middle] - seconds)), middle)
    inc, epochs = case.problem.inc, case.problem.epochs
    first, last = inc.stop[at[0]], inc.stop[at[-1]]
    part = Increments(
        inc.dt[first:last],
        inc.dtheta[first:last],
        inc.dvel[first:last],
        inc.marks[at],
        inc.stop[at] - first,
        inc.rate[at],
        inc.nominal_s,
    )
    taken = {name: getattr(epochs, name)[at] for name in epochs._fields}
    taken |= {"stop": part.stop, "time": part.marks - part.marks[0], "event": np.full(at.size, -1)}
    problem = EstimationProblem(
        part,
        epochs._replace(**taken),
        case.frame,
        case.problem.layout,
        case.problem.antenna_lever_b,
        np.inf,
        0.1,
    )
    spread = np.concatenate(
        [[1.0] * 3, [1.0] * 3, np.radians([1.0, 1.0, 2.0]), problem.layout.sigma0]
    )
    return problem, InitialState(
        whole.nav[at[0]].copy(), whole.x[at[0]].copy(), np.zeros(spread.size), np.diag(spread**2)
    )


def linearised(problem: EstimationProblem, start: InitialState, stop: np.ndarray) -> list[Interval]:
    """Nominal, transition and noise from one to the next of the segment numbers `stop`."""
    imu = problem.layout.kernel_model(INCREMENT_BLOCK_S, problem.aiding_interval_s)
    intervals, earth, n = (
        kernel_intervals(problem.inc),
        kernel_earth(problem.frame),
        problem.layout.size,
    )
    elapsed = np.concatenate([[0.0], np.cumsum(problem.inc.dt)])
    out = [Interval(start.nav, start.x, np.eye(n), np.zeros((n, n)))]
    for i, j in pairwise(stop):
        out.append(
            linearise_interval(
                intervals, i, j, out[-1].nav, out[-1].x, imu, earth, float(elapsed[i])
            )
        )
    return out


def insgnss_run(passes: BlockwisePasses, nav: Array, x: Array) -> tuple[Array, Array]:
    """Smoothed means and covariances about the given nominal."""
    passes.history.nav[:] = nav
    passes.history.x[:] = x
    passes.filter(closed_loop=False)
    smoothed = passes.smooth()
    return smoothed.delta, smoothed.P


def filterpy_run(
    problem: EstimationProblem, start: InitialState, steps: list[Interval], stop: np.ndarray
) -> tuple[Array, Array]:
    """The same by filterpy, at each of its steps."""
    n, epochs = problem.layout.size, problem.epochs
    epoch_of = {int(s): k for k, s in enumerate(problem.inc.stop) if epochs.has_position[k]}
    kf = KalmanFilter(dim_x=n, dim_z=3)
    kf.x, kf.P = np.zeros(n), start.P.copy()
    means, covs = np.empty((stop.size, n)), np.empty((stop.size, n, n))
    for i, step in enumerate(steps):
        if i:
            kf.predict(F=step.Phi, Q=step.Q)
        k = epoch_of.get(int(stop[i]))
        if k is not None:
            lever = rotation_from_quaternion(step.nav[6:]) @ problem.antenna_lever_b
            H = np.zeros((3, n))
            H[:, :3], H[:, 6:9] = np.eye(3), -skew(lever)
            kf.update(epochs.position[k] - step.nav[:3] - lever, R=epochs.position_cov[k], H=H)
        means[i], covs[i] = kf.x, kf.P
    mean, cov, _, _ = kf.rts_smoother(means, covs, [s.Phi for s in steps], [s.Q for s in steps])
    return mean, cov


if __name__ == "__main__":
    main()
