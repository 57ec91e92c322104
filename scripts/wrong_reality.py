"""Wrong reality: what does `insgnss.estimate` do when reality is not what the flight file says?

Simulated recordings (a block and a corridor of 5 min, a drive of 4 min; NavChip at 100 Hz, fixes of
2, 2, 3 cm at 10 Hz) get one fault each, of sizes from harmless to gross, planted in copies of their
records, and are estimated with the flight file of a recording without fault. Positions of the
images, of the drive those of the trajectory at 1 Hz, are compared with the truth. A run is

    covered          every component of every error is below 4 of its sigmas, mean square below 2.5
    culprit          refused, or not covered, and the message names the cause that was planted
    told             the same in general words, or with another cause
    silent           not covered, and nothing is said
    refused wrongly  refused, although it is harmless
    traceback        ended by what is no error of the package

The message is that of the refusal, or the headline, the sentences of the verdict, and the notes and
contradictions among the checks; each case states the patterns that name its cause. Faults that no
data can tell are listed apart and not judged.

    python scripts/wrong_reality.py --write
        all cases, the page into benchmarks/ after every seed
    python scripts/wrong_reality.py --only latency --seeds 1
        those whose name holds a word, to the screen
"""

import argparse
import os
import re
import sys
import textwrap
import time
import zlib
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # matrices of 30 x 30

import numpy as np
from wrong_reality_cases import CASES, NOTHING, RATE_HZ, Case, Scene, camera_late, radii

import insgnss

PAGE = Path(__file__).parents[1] / "benchmarks" / "wrong_reality.md"
MOTIONS = {"ign8": 5.0, "ign6x1": 5.0, "car": 4.0}  # minutes
FIRST_SEED, SEEDS_OF_NOTHING = 700, 10
WORST_Z, MEAN_SQUARE, WIDE = 4.0, 2.5, 0.25
MOST_OFF = 1.5  # factor between the sigmas of a kind and the rms of its errors
SMALL_M = 0.03
VERDICTS = ("covered", "culprit", "told", "silent", "refused wrongly", "traceback")
BAD = VERDICTS[3:]

GENERAL = (  # words that say that the sigmas do not hold
    r"scatter more than|contradict|disagree|do not describe|lost the fixes"
    r"|rejected by the gate|were rejected|time-correlated|are too small"
)
UNSEEN = "unseen constants"
CAUSES = {  # checks that name a cause
    *("antenna lever arm", "GNSS time offset", "clock rate", "IMU scale factors"),
    *(
        "IMU misalignments",
        "IMU noise",
        "IMU warm-up",
        "IMU bias step",
        "gyro delay",
        "receiver dynamics",
        "load-dependent bias",
        "GNSS sigmas",
        "turn-on bias",
    ),
}


@dataclass(frozen=True)
class Run:
    """How one run ended: errors in m and in sigmas, (n, 3), empty where there is no result."""

    case: str
    motion: str
    seed: int
    verdict: str
    message: str
    error: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    z: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    noted: tuple[str, ...] = ()
    blames: bool = False
    use: str = ""  # verdict of report.json
    misused: bool = False  # it allows an image with an error beyond its need and 4 sigmas
    unseen: bool = False  # the culprit is named only as what the flight would not show

    @property
    def square(self) -> float:
        """The mean square of the errors in sigmas; nan without a result."""
        return float(np.mean(self.z**2)) if self.z.size else np.nan

    @property
    def wide(self) -> bool:
        """Whether the sigmas are more than twice what they need to be."""
        return self.verdict == "covered" and self.square < WIDE


@lru_cache(maxsize=4)
def recording(motion: str, seed: int, simulated: tuple[tuple[str, Any], ...]) -> Any:
    """The recording without a planted fault."""
    return insgnss.simulate(
        motion, MOTIONS[motion], imu_rate_hz=RATE_HZ, seed=seed, **dict(simulated)
    )


def run(case: Case, motion: str, seed: int) -> Run:
    """Plant a fault, estimate, and judge."""
    sim = recording(motion, seed, case.simulated)
    mounting = replace(sim.mounting, antenna_sigma_m=None)  # a flight file that does not state it
    events = None if motion == "car" else sim.events
    scene = Scene(sim.imu, sim.gnss, events, mounting, truth=sim.truth.trajectory)
    scene = case.plant(scene, np.random.default_rng([seed, zlib.crc32(case.name.encode())]))
    plane = sim.tangent_plane
    try:
        result = insgnss.estimate(
            *(scene.imu, scene.gnss, scene.events),
            mounting=scene.mounting,
            noise=scene.noise,
            tangent_plane=(*np.degrees([plane.lat, plane.lon]), plane.height),
            trajectory_hz=1.0,
        )
    except insgnss.InsgnssError as refusal:
        message = str(refusal)
        named = "culprit" if re.search(case.culprit, message) else "told"
        verdict = "refused wrongly" if case.harmless else named
        return Run(case.name, motion, seed, verdict, f"refused: {message}")
    except Exception as error:  # whatever is no error of the package is a defect
        return Run(case.name, motion, seed, "traceback", f"{type(error).__name__}: {error}")
    error, sigma = compared(sim, result)
    z = error / sigma
    noted = [check for check in result.checks if check.verdict != "ok"]
    sentences = [result.report["headline"], *result.report["verdict"]]
    parts = [*map(said, noted), *sentences]
    message = " / ".join(parts)
    if np.abs(z).max() < WORST_Z and np.mean(z**2) < MEAN_SQUARE:
        verdict = "covered"
    elif re.search(case.culprit, message):
        verdict = "culprit"
    else:
        spoken = CAUSES & {check.name for check in noted} or re.search(GENERAL, message)
        verdict = "told" if spoken else "silent"
    findings = " / ".join(part for part in parts if not part.startswith(UNSEEN))
    unseen = verdict == "culprit" and not re.search(case.culprit, findings)
    names = tuple(check.name for check in noted)
    blames = any(
        check.name in CAUSES and not re.search(case.culprit, f"{check.name}: {check.found}")
        for check in noted
    )
    return Run(
        *(case.name, motion, seed, verdict, message, error, z, names, blames),
        *(result.report["use"]["verdict"], misused(result, error, z), unseen),
    )


def misused(result: insgnss.ProcessResult, error: np.ndarray, z: np.ndarray) -> bool:
    """Tell whether the verdict allows an image with an error beyond its need and 4 sigmas."""
    use = result.report["use"]
    beyond = ((np.abs(error) > use["need_m"]) & (np.abs(z) > WORST_Z)).any(axis=1)
    if result.eo is not None:
        beyond &= ~np.isin(result.eo.images, use["images"])
    return use["verdict"] != "no" and bool(beyond.any())


def said(check: Any) -> str:
    """The words of a check; of what a flight could not see those alone that it would not show."""
    found = check.found.partition("would not reveal errors of ")[2] or check.found
    return f"{check.name}: {found}"


def compared(sim: Any, result: insgnss.ProcessResult) -> tuple[np.ndarray, np.ndarray]:
    """Errors and sigmas of the positions of images, or of the trajectory, (n, 3), m."""
    if result.eo is not None:
        place = {name: k for k, name in enumerate(sim.truth.eo.images)}
        true = sim.truth.eo.position_m[[place[name] for name in result.eo.images]]
        error, cov = result.eo.position_m - true, result.eo.cov
    else:
        own, span = result.trajectory, sim.truth.trajectory.time[[0, -1]]
        own = own[(own.time >= span[0]) & (own.time <= span[1])]
        true = sim.truth.trajectory.at(own.time)
        meridian, parallel = radii(own.lat, own.height)
        north, east = (own.lat - true.lat) * meridian, (own.lon - true.lon) * parallel
        error, cov = np.stack([north, east, true.height - own.height], axis=1), own.cov
    return error, np.sqrt(np.diagonal(cov, axis1=1, axis2=2))[:, :3]


def square_of(runs: Sequence[Run]) -> float:
    """The mean square, over the runs that have a result, of errors in sigmas; nan without one."""
    squares = [one.square for one in runs if one.z.size]
    return float(np.mean(squares)) if squares else np.nan


def unlike(runs: Sequence[Run]) -> list[str]:
    """The kinds whose sigmas are `MOST_OFF` times too large or too small, with the factor."""
    names = dict.fromkeys(one.case for one in runs)
    rms = {name: square_of([one for one in runs if one.case == name]) ** 0.5 for name in names}
    return [
        f"{name} {factor:.2f}"
        for name, factor in rms.items()
        if factor > MOST_OFF or factor < 1.0 / MOST_OFF
    ]


def row(case: Case, runs: Sequence[Run]) -> str:
    """A line of the table."""
    counts = Counter(one.verdict for one in runs)
    solved = [one for one in runs if one.z.size]
    refused = sum(one.message.startswith("refused") for one in runs)
    cells = ["-", "-"]
    if solved:
        size = 1e3 * np.concatenate([np.linalg.norm(one.error, axis=1) for one in solved])
        z = np.abs(np.concatenate([one.z.ravel() for one in solved]))
        cells = [f"{np.median(size):.1f} / {size.max():.1f}", f"{np.median(z):.2f} / {z.max():.1f}"]
    noted = Counter(name for one in solved for name in set(one.noted))
    notes = ", ".join(f"{name} {count}" for name, count in noted.most_common(4))
    missed = sum(one.verdict != "covered" for one in runs)
    share = f"{100 * counts['culprit'] / missed:.0f} %" if missed else "-"
    shown = [str(counts[word] or "") for word in VERDICTS]
    asides = (sum(one.blames for one in runs), sum(one.wide for one in runs))
    squares = f"{square_of(runs):.2f}" if solved else "-"
    last = case.beyond or notes
    name = f"{case.name} (harmless)" if case.harmless else case.name
    cells = [name, str(len(runs)), str(refused or ""), *shown, share, *cells, squares]
    cells += [*(str(count or "") for count in asides), last]
    return f"| {' | '.join(cells)} |"


COLUMNS = (
    *("what is wrong", "runs", "refused", *VERDICTS, "of which culprit", "mm", "sigmas"),
    "mean square",
    *("another cause", "wide", "noted"),
)
HEADER = f"| {' | '.join(COLUMNS)} |\n|{'---|' * len(COLUMNS)}"


def totals(runs: Sequence[Run]) -> str:
    """Counts of the cases that are judged."""
    counts = Counter(one.verdict for one in runs)
    missed = len(runs) - counts["covered"]
    words = ", ".join(f"{word} {counts[word]}" for word in VERDICTS)
    share = f"; culprit in {100 * counts['culprit'] / missed:.0f} % of the rest" if missed else ""
    small = sum(one.verdict == "silent" and np.abs(one.error).max() < SMALL_M for one in runs)
    return (
        f"{len(runs)} runs: {words}{share}; silent with errors below {1e3 * SMALL_M:.0f} mm"
        f" {small}; culprit named only as what the flight would not show"
        f" {sum(one.unseen for one in runs)}; a note names another cause"
        f" {sum(one.blames for one in runs)}, covered by wide sigmas"
        f" {sum(one.wide for one in runs)}"
    )


def listed(runs: Sequence[Run], verdicts: Sequence[str]) -> list[str]:
    """The runs of some verdicts, one line each."""
    lines = []
    for one in runs:
        if one.verdict in verdicts:
            numbers = one.message
            if one.z.size:
                numbers = (
                    f"worst {np.abs(one.z).max():.1f} sigmas, {1e3 * np.abs(one.error).max():.0f}"
                    f" mm, mean square {np.mean(one.z**2):.1f}; {one.message}"
                )
            numbers = textwrap.shorten(numbers.replace("|", "/"), 240, placeholder=" ...")
            lines.append(f"- {one.verdict}: {one.case}, {one.motion}, seed {one.seed}: {numbers}")
    return lines


def page(cases: Sequence[Case], runs: Sequence[Run], seeds: int) -> str:
    """The page of the docs."""
    own = {case.name: [one for one in runs if one.case == case.name] for case in cases}
    judged = [case for case in cases if not case.beyond]
    beyond = [case for case in cases if case.beyond]
    of_judged = [one for case in judged for one in own[case.name]]
    bad, vague = listed(of_judged, BAD), listed(of_judged, ("told",))
    by_motion = [
        f"- {motion}: " + totals([one for one in of_judged if one.motion == motion])
        for motion in MOTIONS
    ]
    return f"""\
# Wrong reality

Written by `python scripts/wrong_reality.py --write`, which says how it is done. Simulated \
recordings of three motions ({", ".join(MOTIONS)}),
{seeds} seeds each ({max(seeds, SEEDS_OF_NOTHING)} of "nothing wrong"); reality differs from the \
flight file by one fault.

Cases: {len(judged)}. {totals(of_judged)}.

{chr(10).join(by_motion)}

- harmless: must not be refused; it may leave errors that are not covered, and is silent then.
- silent though nothing is wrong: by chance a component in 16 000 is beyond {WORST_Z:g} sigmas, \
and a run has 114, 261 or 720 of them;
  the motions of one seed share the noise of their fixes, and so such chances.
- refused: runs without a result; they count as culprit, told or refused wrongly.
- of which culprit: share among the runs that are not covered.
- mm: error of a position, median / worst over all runs with a result; sigmas: the same of its \
components in standard deviations.
- mean square: of the components in standard deviations, mean of the runs. Beyond a factor of \
{MOST_OFF} between the
  rms of the errors and their sigmas: {"; ".join(unlike(of_judged)) or "none"}.
- another cause: runs with a result in which a check names a cause that was not planted; wide: \
mean square below {WIDE:g}.
- noted: notes among the checks, and in how many runs.

{HEADER}
{chr(10).join(row(case, own[case.name]) for case in judged)}

## Silent, refused wrongly, tracebacks

{chr(10).join(bad) or "None."}

## Told in general words, or with another cause

{chr(10).join(vague) or "None."}

## What no data can tell

Not judged; the last column says why.

{HEADER}
{chr(10).join(row(case, own[case.name]) for case in beyond)}
"""


def rounds(
    cases: Sequence[Case], seeds: range, motions: Sequence[str]
) -> Iterator[list[tuple[int, str, int]]]:
    """Jobs (case, motion, seed), a list for every seed; the first has all seeds of no fault."""
    for seed in seeds:
        jobs = [
            (CASES.index(case), motion, seed)
            for motion in motions
            for case in cases
            if case is not NOTHING and (motion != "car" or case.plant is not camera_late)
        ]
        if seed == seeds.start and NOTHING in cases:
            every = range(seed, seed + max(len(seeds), SEEDS_OF_NOTHING))
            jobs += [(CASES.index(NOTHING), motion, one) for motion in motions for one in every]
        yield jobs


def perform(job: tuple[int, str, int]) -> Run:
    """One job, by numbers, which another process can take."""
    case, motion, seed = job
    return run(CASES[case], motion, seed)


def main() -> int:
    """Run the campaign."""
    parser = argparse.ArgumentParser(description="Estimate recordings that the flight file misses")
    parser.add_argument("--seeds", type=int, default=3, help="of every case and motion")
    parser.add_argument("--first", type=int, default=FIRST_SEED, help="the first of them")
    parser.add_argument("--motions", nargs="+", choices=MOTIONS, default=list(MOTIONS))
    parser.add_argument("--only", default="", metavar="WORD", help="cases whose name holds this")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--write", action="store_true", help=f"write benchmarks/{PAGE.name}")
    options = parser.parse_args()
    cases = [case for case in CASES if options.only in case.name]
    runs: list[Run] = []
    with ProcessPoolExecutor(options.processes) as pool:
        seeds = range(options.first, options.first + options.seeds)
        for done, jobs in enumerate(rounds(cases, seeds, options.motions), 1):
            for one in map(perform, jobs) if options.processes == 1 else pool.map(perform, jobs):
                runs.append(one)
                worst = np.abs(one.z).max(initial=0.0)
                print(
                    f"{time.process_time():6.0f} s {one.motion:7}{one.seed} {one.case}:"
                    f" {one.verdict}, {worst:.1f} sigmas, square {one.square:.2f}, use: {one.use}"
                    f"{' WRONGLY' if one.misused else ''}, {one.message[:400]}",
                    flush=True,
                )
            if options.write:
                PAGE.write_text(page(cases, runs, done), encoding="utf-8", newline="\n")
    print(
        "",
        HEADER,
        *(row(case, [r for r in runs if r.case == case.name]) for case in cases),
        sep="\n",
    )
    judged = [one for one in runs if not next(c for c in cases if c.name == one.case).beyond]
    bad = listed(judged, BAD)
    print("", totals(judged), *listed(judged, (*BAD, "told")), sep="\n")
    print(
        "", f"rms of the errors in sigmas beyond a factor of {MOST_OFF}:", *unlike(judged), sep="\n"
    )
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
