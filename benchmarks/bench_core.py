"""The core: CPU microseconds per IMU sample of increments, alignment, filter and smoother on the
bar's 15-minute block flight.

    python benchmarks/bench_core.py [--minutes 15] [--repeats 9]

`solve` is what `insgnss process` calls: filter, smoother of the means, further passes where the
flight asks for them, smoother with the full covariance of every state at every epoch and exposure.
The bar is alignment and solve together under 1 microsecond.
"""

import argparse

import numpy as np
from common import block_flight, median_cpu, one_thread

from insgnss.navigation.align.initial import initial_state
from insgnss.navigation.filter.blocks import BlockwisePasses
from insgnss.navigation.filter.filter import make_history, run_filter
from insgnss.navigation.filter.layout import FixErrors
from insgnss.navigation.filter.solution import solve

BAR_US = 1.0


def main() -> None:
    one_thread()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=15.0)
    parser.add_argument("--repeats", type=int, default=9)
    options = parser.parse_args()

    # lever arm and stamps as `process` carries them by default
    fix_errors = FixErrors(lever_arm_m=0.005, time_offset_s=2e-4)
    case = block_flight(options.minutes, fix_errors=fix_errors)
    problem, start = case.problem, initial_state(case.problem).start
    solution = solve(problem, start)
    history, m = make_history(problem.epochs, problem.layout), problem.epochs.stop.size
    passes = BlockwisePasses(problem, start, np.arange(m), 100, m)

    def filter_and_smooth() -> None:
        passes.filter()
        passes.smooth()

    steps = {
        "increments": case.increments,
        "align": lambda: initial_state(problem),
        "filter, one pass": lambda: run_filter(problem, start, history),
        "filter and smoother, one pass": filter_and_smooth,
        "solve": lambda: solve(problem, start),
    }
    us = {
        name: 1e6 * median_cpu(run, options.repeats) / case.samples for name, run in steps.items()
    }
    print(
        f"{case.samples} samples, {problem.epochs.stop.size} epochs, {case.at_event.size}"
        f" exposures, {problem.layout.size} states, ",
        end="",
    )
    print(
        f"{solution.passes} filter pass{'es' if solution.passes > 1 else ''}; CPU microseconds a"
        f" sample, medians of {options.repeats}"
    )
    for name, value in us.items():
        print(f"  {name:32} {value:7.3f}")
    print(
        f"  {'smoother (difference)':32}"
        f" {us['filter and smoother, one pass'] - us['filter, one pass']:7.3f}"
    )
    print(f"  {'align + solve':32} {us['align'] + us['solve']:7.3f}   (bar: {BAR_US:g})")


if __name__ == "__main__":
    main()
