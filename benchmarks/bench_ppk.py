"""PPK against its engine: CPU of RTKLIB's two runs, of each, and of all else that makes antenna
positions of them.

    python benchmarks/bench_ppk.py ROVER BASE NAVIGATION... [--base-position X Y Z] [--repeats 3]

X Y Z is the phase centre of the base's antenna, ECEF, m; without it the header's approximate
position is taken. CPU time is what the system accounts to this process and to those that it ran
(os.times), after one run that compiles the kernels. The bar is 1.2.
"""

import argparse
import os
import statistics
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

from common import one_thread

from insgnss.gnss.engine.rtklib import solve
from insgnss.gnss.options import EngineOptions
from insgnss.gnss.ppk import PpkInput, solve_ppk


class Run(NamedTuple):
    """Seconds: CPU of the whole, of the engine's two runs, and wall."""

    cpu: float
    engine: float
    wall: float


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("rover", type=Path)
    parser.add_argument("base", type=Path)
    parser.add_argument("navigation", type=Path, nargs="+")
    parser.add_argument("--base-position", type=float, nargs=3)
    parser.add_argument("--repeats", type=int, default=3)
    given = parser.parse_args()
    options = EngineOptions()
    if given.base_position is not None:
        options = EngineOptions(base_position_m=tuple(given.base_position), base_point="apc")
    with tempfile.TemporaryDirectory() as scratch:
        run = solve(given.rover, given.base, given.navigation, options, scratch)
        print(
            f"{run.engine}, CPU s: "
            + ", ".join(f"{name} {cpu:.2f}" for name, cpu in run.cpu_of.items())
        )
        task = PpkInput(
            rover=given.rover, base=given.base, navigation=tuple(given.navigation), options=options
        )
        measured(task, Path(scratch))
        runs = [measured(task, Path(scratch)) for _ in range(given.repeats)]
    cpu, engine, wall = (statistics.median(values) for values in zip(*runs, strict=True))
    ratio = statistics.median(r.cpu / r.engine for r in runs)
    print(
        f"medians of {given.repeats}: {cpu:.2f} s CPU, of which the engine {engine:.2f}; {wall:.2f}"
        " s wall"
    )
    print(f"ratio of CPU {ratio:.3f}   (bar: 1.2)")


def measured(task: PpkInput, directory: Path) -> Run:
    """One solution."""
    before, start = os.times(), time.perf_counter()
    result = solve_ppk(task, directory)
    after, wall = os.times(), time.perf_counter() - start
    return Run(sum(after[:4]) - sum(before[:4]), result.cpu_s, wall)


if __name__ == "__main__":
    one_thread()
    main()
