"""The whole command: `insgnss process` of a 45-minute 500 Hz flight against a bare pandas.read_csv
of its IMU file, and what other flights take.

    python benchmarks/bench_process.py [--minutes 45] [--repeats 5] [--directory DIR] [--others]

Both are processes of their own, run in turn; CPU and peak memory are those that the system accounts
to each (os.wait4). The ratio of CPU is the median of the pairs; the bar is 2.2, all products, on
a machine at rest. The same command with a table [[measurement]] of headings at every fix (0.2 deg)
runs in the same turns; the bar of its ratio to that without is 1.3. The split by step is CPU time,
from report.json. Also the wall time of `insgnss --help`, and the very first run, with an empty
compiler cache. With --others, single runs of flights of 15 minutes, 15 minutes from RINEX (`pip
install '.[ppk]'`) and 45 minutes, as a user would have them. DIR keeps the flight for another time.
Modules are compiled to bytecode once, as pip does when it installs them, whatever
PYTHONDONTWRITEBYTECODE says here: half a second of every run else.
"""

import argparse
import importlib.util
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
from common import processor

from insgnss.geodesy.rotation import rpy_from_rotation

COMMAND = [sys.executable, "-m", "insgnss"]
BAR = 2.2
HEADING_BAR = 1.3


class Run(NamedTuple):
    """One process: seconds of wall and CPU time, peak resident memory in MB."""

    wall: float
    cpu: float
    memory: float


def run(command: list[str], **environment: str) -> Run:
    """Run a command to its end, its output thrown away; its failure is ours."""
    surroundings = {
        name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"
    }
    start = time.perf_counter()
    child = subprocess.Popen(command, stdout=subprocess.DEVNULL, env=surroundings | environment)
    _, status, used = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode:
        raise SystemExit(f"{' '.join(command)}: exit code {child.returncode}")
    return Run(time.perf_counter() - start, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024)


def medians(runs: list[Run]) -> Run:
    """Field by field; of the memory the greatest."""
    return Run(
        statistics.median(r.wall for r in runs),
        statistics.median(r.cpu for r in runs),
        max(r.memory for r in runs),
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=45.0)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--directory", type=Path)
    parser.add_argument("--others", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        compare(
            options.directory or Path(scratch) / "flight",
            options.minutes,
            options.repeats,
            Path(scratch),
        )
        if options.others:
            others(Path(scratch))


def with_headings(flight: Path) -> Path:
    """The flight file with a heading of 0.2 deg at every fix, which two antennas may give."""
    truth = np.load(flight / "truth" / "trajectory.npz")
    heading = np.degrees(rpy_from_rotation(truth["C_nb"])[:, 2])
    heading += 0.2 * np.random.default_rng(1).standard_normal(heading.size)
    table = np.column_stack([truth["tow"], heading])[10:-10]
    np.savetxt(flight / "heading.csv", table, "%.6f", ",", header="tow,heading", comments="")
    sensor = '\n[[measurement]]\nkind = "heading"\nfile = "heading.csv"\nsigma = 0.2\n'
    file = flight / "with_headings.toml"
    file.write_text((flight / "flight.toml").read_text() + sensor)
    return file


def compare(flight: Path, minutes: float, repeats: int, scratch: Path) -> None:
    if not flight.exists():
        run([*COMMAND, "simulate", str(flight), "--minutes", str(minutes), "--seed", "5"])
    imu = next(flight.glob("01_Observations/IMU/Data/Pre_calibrated/*.csv"))
    process = [*COMMAND, "process", str(flight), "--out", str(scratch / "out")]
    equipped = [*COMMAND, "process", str(with_headings(flight)), "--out", str(scratch / "with")]
    pandas = [sys.executable, "-c", f"import pandas; pandas.read_csv({str(imu)!r})"]
    for each in (process, equipped):
        run(each)  # warms the compiler cache and the file cache
    ours, headings, theirs, helps, steps = [], [], [], [], []
    for _ in range(repeats):
        theirs.append(run(pandas))
        ours.append(run(process))
        headings.append(run(equipped))
        helps.append(run([*COMMAND, "--help"]))
        steps.append(json.loads((scratch / "out" / "report.json").read_text())["timings_s"])
    a, b, c = medians(ours), medians(theirs), medians(headings)
    ratio, of_headings = (
        statistics.median(x.cpu / y.cpu for x, y in zip(some, others, strict=True))
        for some, others in ((ours, theirs), (headings, ours))
    )
    print(processor())
    print(
        f"{minutes:g} minutes, {imu.stat().st_size / 1e6:.0f} MB of IMU file; medians of {repeats},"
        " in turn"
    )
    print(f"  insgnss process     {a.cpu:6.2f} s CPU {a.wall:6.2f} s wall {a.memory:6.0f} MB peak")
    print(f"  pandas.read_csv     {b.cpu:6.2f} s CPU {b.wall:6.2f} s wall {b.memory:6.0f} MB peak")
    print(f"  ratio of CPU        {ratio:6.2f}                                  (bar: {BAR:g})")
    print(f"  with headings       {c.cpu:6.2f} s CPU {c.wall:6.2f} s wall {c.memory:6.0f} MB peak")
    print(f"  ratio to without    {of_headings:6.2f}  (bar: {HEADING_BAR:g})")
    named = {name: statistics.median(s[name] for s in steps) for name in steps[0]}
    inside = sum(named.values())
    print("  CPU by step         " + ", ".join(f"{n} {s:.2f}" for n, s in named.items()))
    print(f"                      start, report and writing {a.cpu - inside:.2f}")
    print(
        f"  insgnss --help      {medians(helps).wall:6.2f} s wall                           (bar:"
        " 0.1)"
    )
    short = scratch / "short"
    run([*COMMAND, "simulate", str(short), "--minutes", "5", "--seed", "5"])
    cold = run([*COMMAND, "process", str(short)], NUMBA_CACHE_DIR=str(scratch / "cache"))
    print(
        f"  first run ever      {cold.cpu:6.2f} s CPU {cold.wall:6.2f} s wall, 5 minutes of flight"
        " (bar: 40)"
    )


def others(scratch: Path) -> None:
    """Print what single runs of flights of other lengths and sources take."""
    print("other flights, single runs")
    for minutes, raw in ((15, False), (15, True), (45, False)):
        if raw and importlib.util.find_spec("pyrtklib5") is None:
            print("  from RINEX: pyrtklib5 is not installed")
            continue
        flight = scratch / f"flight{minutes}{'r' * raw}"
        simulated = [*COMMAND, "simulate", str(flight), "--minutes", str(minutes), "--seed", "5"]
        run([*simulated, *(["--raw-gnss"] if raw else [])])
        one = run([*COMMAND, "process", str(flight)])
        what = f"{minutes} minutes{' from RINEX' if raw else ''}"
        print(f"  {what:<22}{one.wall:6.1f} s wall {one.cpu:6.1f} s CPU {one.memory:6.0f} MB peak")


if __name__ == "__main__":
    main()
