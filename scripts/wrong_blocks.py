"""Wrong blocks: what does `insgnss adjust` do when its files are not what they are said to be?

Two simulated flights with their image observations (ign8 with control and check points, the
corridor ign6x1 with check points alone) are processed; each kind of wrong input is planted alone in
copies of their files, and `insgnss adjust block.toml` runs. Adjusted poses are compared with the
truth. A run is

    culprit          refused, or told with its result, and the message names what was planted
    covered          a result within its standard deviations, and nothing was told
    told             refused, or told with its result, in general words or with another cause
    silent           a result of "consistent" that is off by more than 5 of its standard deviations
    wrongly          harmless, and refused or called contradictory
    traceback        ended by what is no error of the package
    lines            refused in more than one line

The message is the line of the refusal, or everything that the terminal shows. Good blocks of other
seeds, sizes and numbers of control points are adjusted as well: none may be contradicted.

    python scripts/wrong_blocks.py --write
        all cases, the page into benchmarks/
    python scripts/wrong_blocks.py --only mirrored
        those whose name holds a word, to the screen
"""

import argparse
import contextlib
import io
import json
import os
import re
import shutil
import sys
import tempfile
import textwrap
import time
import traceback
import zlib
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # on a shared machine more threads only spin

import numpy as np
from wrong_blocks_cases import CASES, EO, Case, Scene

from insgnss import read_eo
from insgnss.cli.main import main as insgnss
from insgnss.flight.config.load import load_flight
from insgnss.flight.processing.pipeline import process
from insgnss.geodesy.rotation import vector_from_rotation
from insgnss.simulation.dataset import write_dataset
from insgnss.simulation.image_block import BlockOptions

PAGE = Path(__file__).parents[1] / "benchmarks" / "wrong_blocks.md"
FLIGHTS = ("ign8", "ign6x1")
MINUTES, SEED, GOOD_SEED = 5.0, 40, 60
WORST_Z, MEAN_SQUARE = 5.0, 2.5
VERDICTS = ("culprit", "covered", "told", "silent", "wrongly", "traceback", "lines")
BAD = VERDICTS[3:]
ON_FLIGHT = {"ign8": {"tie_points": 30.0, "control": 8, "check": 5}, "ign6x1": {"tie_points": 30.0}}
GOOD: tuple[tuple[str, float, dict[str, Any]], ...] = (
    ("ign8", 5.0, {"control": 0, "check": 8}),
    ("ign8", 5.0, {"control": 3, "check": 8}),
    ("ign8", 5.0, {"control": 25, "check": 8}),
    ("ign8", 7.0, {"control": 12, "check": 8, "tie_points": 12.0}),
    ("ign8", 5.0, {"control": 8, "check": 5, "gross_errors": 0.02}),
    ("ign8", 9.0, {"control": 21, "check": 4}),
    ("ign8", 6.0, {"control": 5, "check": 5, "tie_points": 20.0, "matched": 0.3}),
    ("ign8", 5.0, {"control": 6, "check": 0, "tie_sigma_px": 0.3}),
    ("ign6x1", 5.0, {}),
    ("ign6x1", 8.0, {"tie_points": 20.0}),
    ("ign6x1", 5.0, {"gross_errors": 0.02}),
    ("ign6x1", 5.0, {"control": 3, "tie_points": 12.0}),
)


@dataclass(frozen=True)
class Run:
    """How one run ended; z is the largest error in its sigmas, NaN without a result."""

    case: str
    flight: str
    verdict: str
    code: int
    message: str
    worst_m: float = np.nan
    z: float = np.nan
    mean_square: float = np.nan
    seconds: float = 0.0


def flown(directory: Path, flight: str, minutes: float, seed: int, **options: Any) -> None:
    """Simulate and process a flight with its block."""
    block = replace(BlockOptions.of(flight), **options)
    write_dataset(
        directory, flight, minutes, imu_rate=100.0, seed=seed, start_in_air=True, block=block
    )
    process(load_flight(directory), write=True)


def run(case: Case, flight: str, flights: Path) -> Run:
    """Plant a fault, adjust, and judge."""
    with tempfile.TemporaryDirectory() as temporary:
        directory = Path(temporary) / "flight"
        shutil.copytree(flights / flight, directory)
        if case.mounting:
            (directory / "other.toml").write_text(f"[mounting]\n{case.mounting}\n")
            words = ["process", str(directory / "flight.toml"), "-q"]
            quiet = io.StringIO()
            with contextlib.redirect_stdout(quiet), contextlib.redirect_stderr(quiet):
                code = insgnss([*words, "--mounting", str(directory / "other.toml")])
            if code:
                raise RuntimeError(f"{case.name}, {flight}: {quiet.getvalue()}")
        scene = Scene.of(directory, flights, flight)
        case.plant(scene, np.random.default_rng(zlib.crc32(case.name.encode())))
        scene.write()
        return judged(case, flight, directory)


def judged(case: Case, flight: str, directory: Path) -> Run:
    """Adjust a block and judge how it ended."""
    out, err = io.StringIO(), io.StringIO()
    start = time.monotonic()
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            code = insgnss(["adjust", str(directory / "block.toml"), "-q"])
    except Exception:  # whatever is no error of the package is a defect
        err.write(traceback.format_exc())
        code = 1
    taken = time.monotonic() - start
    text = out.getvalue().replace(str(directory), "")
    lines = [row for row in err.getvalue().replace(str(directory), "").splitlines() if row]

    def ended(verdict: str, message: str, *numbers: float) -> Run:
        return Run(case.name, flight, verdict, code, message, *numbers, seconds=taken)

    if code not in (0, 2, 3, 4):
        return ended("traceback", lines[-1] if lines else "")
    if code:
        message = lines[0] if lines else ""
        if len(lines) != 1 or not lines[0].startswith("insgnss: error: "):
            return ended("lines", " | ".join(lines))
        if case.harmless:
            return ended("wrongly", message)
        return ended("culprit" if re.search(case.culprit, message) else "told", message)
    kept = [row for row in text.splitlines() if not row.startswith("wrote ")]
    document = json.loads((directory / "out/adjust.json").read_text())
    numbers = compared(directory)
    covered = not numbers[1] > WORST_Z and not numbers[2] > MEAN_SQUARE
    told = document["verdict"] != "consistent"
    if case.harmless and told:
        verdict = "wrongly"
    elif case.harmless:
        verdict = "covered" if covered else "silent"
    elif re.search(case.culprit, " ".join(kept)):
        verdict = "culprit"
    elif told:
        verdict = "told"
    else:
        verdict = "covered" if covered else "silent"
    return ended(verdict, " / ".join(kept), *numbers)


def compared(directory: Path) -> tuple[float, float, float]:
    """Largest error of a position, m, and of a component in sigmas, mean square of these."""
    path = directory / "out/eo.json"
    if not path.is_file():
        return np.nan, np.nan, np.nan
    eo = read_eo(path)
    with np.load(directory / "truth/eo.npz") as file:
        row = {str(name).split(".")[0].lower(): k for k, name in enumerate(file["images"])}
        rows = [row[re.split(r"[\\/]", name)[-1].split(".")[0].lower()] for name in eo.images]
        X, C = file["position_enu"][rows], file["C_mc"][rows]
    psi = vector_from_rotation(C @ eo.C_mc.swapaxes(1, 2))
    e = np.hstack([X - eo.position_m, psi])
    z = e / np.sqrt(np.diagonal(eo.cov, axis1=1, axis2=2))
    worst = float(np.abs(e[:, :3]).max())
    return worst, float(np.abs(z).max()), float(np.mean(z**2))


def row(one: Run) -> str:
    """A line of the table."""
    off = "" if np.isnan(one.worst_m) else f"{1e3 * one.worst_m:.0f}"
    z = "" if np.isnan(one.z) else f"{one.z:.1f}"
    message = textwrap.shorten(one.message.replace("|", "/"), 260, placeholder=" ...")
    message = message.replace("<", "&lt;")
    cells = [one.case, one.flight, one.verdict, str(one.code), off, z, message]
    return f"| {' | '.join(cells)} |"


COLUMNS = ("what is wrong", "flight", "ended as", "exit code", "mm", "sigmas", "message")
HEADER = f"| {' | '.join(COLUMNS)} |\n|{'---|' * len(COLUMNS)}"


def totals(runs: Sequence[Run]) -> str:
    """Counts of verdicts."""
    counts = Counter(one.verdict for one in runs)
    return ", ".join(f"{word} {counts[word]}" for word in VERDICTS)


def page(runs: Sequence[Run], good: Sequence[Run]) -> str:
    """The page of the docs."""
    harmless = {case.name for case in CASES if case.harmless}
    unseen = {case.name for case in CASES if case.beyond}
    wrong = [one for one in runs if one.case not in harmless | unseen]
    fine = [one for one in runs if one.case in harmless]
    return f"""\
# Wrong blocks

Written by `python scripts/wrong_blocks.py --write`, which says how it is done. Flights: ign8 with \
8 control and 5 check points, the corridor
ign6x1 with check points alone; each fault is planted alone.

- Wrong inputs, {len({one.case for one in wrong})} kinds, {len(wrong)} runs: {totals(wrong)}.
- Harmless ones, {len({one.case for one in fine})} kinds, {len(fine)} runs: {totals(fine)}.
- Good blocks of other seeds: {len(good)}, {totals(good)}.

mm: largest error of a position; sigmas: of a component of a pose in its standard deviations; both \
of runs that wrote an orientation.

{HEADER}
{chr(10).join(map(row, wrong))}

## Harmless

{HEADER}
{chr(10).join(map(row, fine))}

## What no data can tell

{chr(10).join(f"- {case.name}: {case.beyond}." for case in CASES if case.beyond)}

{HEADER}
{chr(10).join(row(one) for one in runs if one.case in unseen)}

## Good blocks

{HEADER}
{chr(10).join(map(row, good))}
"""


def perform(job: tuple[int, str, Path]) -> Run:
    """Run one case on one flight, by numbers, which another process can take."""
    case, flight, flights = job
    return run(CASES[case], flight, flights)


def perform_good(job: tuple[int, Path]) -> Run:
    """Adjust one block without fault."""
    k, directory = job
    flight, minutes, options = GOOD[k]
    into = directory / f"good_{k}"
    flown(into, flight, minutes, GOOD_SEED + k, **options)
    words = ", ".join(f"{name} {value:g}" for name, value in options.items())
    case = Case(f"{minutes:g} min; {words or 'as it is'}", harmless=True)
    Scene.of(into, directory, flight).write()
    one = judged(case, flight, into)
    shutil.rmtree(into)
    return one


def main() -> int:
    """Run the campaign."""
    parser = argparse.ArgumentParser(description="Adjust blocks that are not what their files say")
    parser.add_argument("--only", default="", metavar="WORD", help="cases whose name holds this")
    parser.add_argument("--flights", type=Path, help="directory that keeps the flights")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--no-good", action="store_true", help="leave the good blocks out")
    parser.add_argument("--write", action="store_true", help=f"write benchmarks/{PAGE.name}")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        flights = options.flights or Path(temporary)
        for flight in FLIGHTS:
            if not (flights / flight / EO).is_file():
                flown(flights / flight, flight, MINUTES, SEED, **ON_FLIGHT[flight])
        runs: list[Run] = []
        good: list[Run] = []
        jobs = [
            (k, flight, flights)
            for k, case in enumerate(CASES)
            for flight in case.flights
            if options.only in case.name
        ]
        good_jobs = [] if options.no_good else [(k, Path(temporary)) for k in range(len(GOOD))]
        with ProcessPoolExecutor(options.processes) as pool:
            for into, results in (
                (runs, pool.map(perform, jobs)),
                (good, pool.map(perform_good, good_jobs)),
            ):
                for one in results:
                    into.append(one)
                    print(f"{one.seconds:5.1f} s {row(one)}", flush=True)
    print(totals(runs), totals(good), sep="\n")
    if options.write:
        PAGE.write_text(page(runs, good), encoding="utf-8", newline="\n")
    judged_names = {case.name for case in CASES if not case.beyond}
    judged_runs = [*(one for one in runs if one.case in judged_names), *good]
    return 1 if any(one.verdict in BAD for one in judged_runs) else 0


if __name__ == "__main__":
    sys.exit(main())
