"""Peak memory of `insgnss process`, each flight a process of its own.

    python benchmarks/bench_memory.py [--directory DIR] [--hours 8] [--only TEXT]

45 minutes at 500 Hz with fixes at 10 Hz, the same with fixes at 200 Hz, and hours of it. Peak
resident memory, wall and CPU time are those that the system accounts to the process (os.wait4), all
products written. The flights are simulated first (8 hours: 1.3 GB of text, 3 minutes, 5 GB of
memory) and kept in DIR for another time.
"""

import argparse
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from bench_process import COMMAND, run

from insgnss.simulation.dataset import write_dataset
from insgnss.simulation.scenario import GnssOptions

BARS_MB = {"45 min, 500 Hz": 300, "45 min, 500 Hz, fixes at 200 Hz": 2000, "hours, 500 Hz": 2000}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--directory", type=Path)
    parser.add_argument("--hours", type=float, default=8.0)
    parser.add_argument("--only", default="")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        root = options.directory or Path(scratch)
        cases: dict[str, Callable[[Path], object]] = {
            "45 min, 500 Hz": lambda to: write_dataset(to, "ign8", 45.0, seed=5),
            "45 min, 500 Hz, fixes at 200 Hz": lambda to: write_dataset(
                to, "ign8", 45.0, seed=5, gnss=GnssOptions(rate_hz=200.0)
            ),
            "hours, 500 Hz": lambda to: write_dataset(to, "ign8", 60.0 * options.hours, seed=5),
        }
        for name, make in cases.items():
            if options.only not in name:
                continue
            flight = root / name.replace(", ", "_").replace(" ", "_")
            if not flight.exists():
                make(flight)
            taken = run([*COMMAND, "process", str(flight), "--out", str(Path(scratch) / "out")])
            print(
                f"{name:34} peak {taken.memory:6.0f} MB (bar {BARS_MB[name]}), wall"
                f" {taken.wall:6.1f} s, CPU {taken.cpu:6.1f} s"
            )


if __name__ == "__main__":
    sys.exit(main())
