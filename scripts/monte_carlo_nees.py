"""Monte Carlo of short block flights: are the errors as large as the covariances say?

Every flight is simulated with its own gusts, IMU errors (Table 5 of paper 000 with turn-on biases)
and fixes, aligned, filtered and smoothed from the data alone, and compared with the truth at one
camera event in its middle. The error squared over its covariance (NEES) of position, velocity and
attitude together is chi-square of nine degrees of freedom, its sum over N flights of 9 N: filter
and smoother must lie within the two-sided 99 % bounds, and so must the single components of the
smoother, together.

    python scripts/monte_carlo_nees.py --flights 200 --minutes 1 --seed 0

prints a table, writes a figure, and ends with an error where a bound is broken.
"""

import argparse
import os
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # matrices of 30 x 30

import numpy as np
from scipy.stats import chi2

from insgnss.geodesy.rotation import rotation_from_quaternion, vector_from_rotation
from insgnss.navigation.align.initial import initial_state
from insgnss.navigation.filter.epochs import make_epochs
from insgnss.navigation.filter.filter import gate_from_sigma, make_history, run_filter
from insgnss.navigation.filter.layout import state_layout
from insgnss.navigation.filter.problem import EstimationProblem
from insgnss.navigation.filter.solution import solve
from insgnss.navigation.noise_model.model import load_noise_model
from insgnss.navigation.prepare.clock import cut_fixes
from insgnss.navigation.prepare.increments import body_increments, merge_marks
from insgnss.simulation.motion import ExactMotion
from insgnss.simulation.scenario import ImuOptions, SimulatedFlight, simulate_flight

COMPONENTS = (
    "north",
    "east",
    "down",
    "v north",
    "v east",
    "v down",
    "psi north",
    "psi east",
    "psi down",
)


def problem_of(sim: SimulatedFlight, instant: float) -> tuple[EstimationProblem, int]:
    """The estimation problem of a simulated flight, and the epoch of the instant that is judged."""
    fixes = cut_fixes(sim.gnss, sim.imu.time[0], sim.imu.time[-1])
    marks, (at_fix, at_event) = merge_marks(fixes.time, np.array([instant]))
    inc = body_increments(sim.imu, np.eye(3), marks)
    frame = sim.flight.motion.frame
    epochs = make_epochs(inc, at_fix, fixes, at_event, frame)
    layout = state_layout(load_noise_model("navchip"))
    return EstimationProblem(
        inc, epochs, frame, layout, sim.rig.antenna_lever_b, gate_from_sigma(5.0), 0.1
    ), int(at_event[0])


def error_of(nav: np.ndarray, motion: ExactMotion, time: float) -> np.ndarray:
    """(9,) truth minus the state nav (10,)."""
    psi = vector_from_rotation(motion.C_lb(time)[0] @ rotation_from_quaternion(nav[6:]).T)
    return np.concatenate(
        [motion.position(time)[0] - nav[:3], motion.velocity(time)[0] - nav[3:6], psi]
    )


def judge_flight(seed: int, minutes: float) -> tuple[float, float, np.ndarray]:
    """NEES of filter and smoother, and the smoother's errors over their sigmas (9,), at one instant
    of one flight.
    """
    imu = ImuOptions(rate_hz=100.0, noise="navchip")
    sim = simulate_flight(
        "ign8", minutes, seed=seed, imu=imu, start_in_air=True, line_length_m=120.0
    )
    motion = sim.flight.motion
    problem, k = problem_of(sim, motion.start + 0.6 * (motion.end - motion.start) + 0.0333)
    time = problem.inc.marks[k]
    start = initial_state(problem).start
    history = make_history(problem.epochs, problem.layout)
    run_filter(problem, start, history)
    filtered = error_of(history.nav[k], motion, time) - history.m[k, :9]
    solution = solve(problem, start)
    smoothed, P = error_of(solution.nav[k], motion, time), solution.nav_covariance()[k]
    of_filter = filtered @ np.linalg.solve(history.P[k, :9, :9], filtered)
    return (
        float(of_filter),
        float(smoothed @ np.linalg.solve(P, smoothed)),
        smoothed / np.sqrt(np.diag(P)),
    )


def draw(filter_nees: np.ndarray, smoother_nees: np.ndarray, path: Path) -> None:
    """Distribution of the single flights against chi-square."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axis = plt.subplots(figsize=(7.0, 4.2), layout="constrained")
    share = (np.arange(filter_nees.size) + 0.5) / filter_nees.size
    grid = np.linspace(0.0, max(30.0, filter_nees.max(), smoother_nees.max()), 300)
    axis.plot(grid, chi2.cdf(grid, 9), color="0.3", label="chi-square, 9 degrees of freedom")
    axis.step(np.sort(filter_nees), share, label=f"filter, mean {filter_nees.mean():.2f}")
    axis.step(np.sort(smoother_nees), share, label=f"smoother, mean {smoother_nees.mean():.2f}")
    axis.set(
        xlabel="NEES of position, velocity and attitude",
        ylabel="share of flights",
        title=f"{filter_nees.size} simulated flights",
    )
    axis.legend()
    axis.grid(alpha=0.3)
    figure.savefig(path, dpi=120)


def main() -> None:
    """Fly, judge, print, draw, and hold the sums against their bounds."""
    parser = argparse.ArgumentParser(
        description="Consistency of filter and smoother over many simulated flights"
    )
    parser.add_argument("--flights", type=int, default=50)
    parser.add_argument("--minutes", type=float, default=1.0, help="of each flight")
    parser.add_argument(
        "--seed", type=int, default=0, help="of the first flight; the others count up"
    )
    parser.add_argument("--figure", type=Path, default=Path("monte_carlo_nees.png"))
    options = parser.parse_args()
    of_filter, of_smoother, scaled = (
        np.array(column)
        for column in zip(
            *(judge_flight(options.seed + i, options.minutes) for i in range(options.flights)),
            strict=True,
        )
    )
    n = options.flights
    low, high = chi2.ppf([0.005, 0.995], 9 * n)
    print(
        f"{n} flights of {options.minutes:g} min, NEES over 9 degrees of freedom; 99 % bounds"
        f" {low / (9 * n):.3f} to {high / (9 * n):.3f}"
    )
    print(f"  filter    {of_filter.sum() / (9 * n):.3f}")
    print(f"  smoother  {of_smoother.sum() / (9 * n):.3f}")
    one_low, one_high = chi2.ppf([0.005 / 9, 1.0 - 0.005 / 9], n)
    squares = (scaled**2).sum(axis=0)
    print(
        f"components of the smoother, bounds {one_low / n:.3f} to {one_high / n:.3f}, and their"
        " mean in units of its sigma"
    )
    for name, square, mean in zip(
        COMPONENTS, squares / n, scaled.mean(axis=0) * np.sqrt(n), strict=True
    ):
        print(f"  {name:<10}{square:.3f}  {mean:+.2f}")
    draw(of_filter, of_smoother, options.figure)
    print(f"figure: {options.figure}")
    assert low < of_filter.sum() < high, "the filter's covariance does not fit its errors"
    assert low < of_smoother.sum() < high, "the smoother's covariance does not fit its errors"
    assert (squares > one_low).all(), "a component's sigma is too large"
    assert (squares < one_high).all(), "a component's sigma is too small"


if __name__ == "__main__":
    main()
