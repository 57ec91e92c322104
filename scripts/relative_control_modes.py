"""Table 4 of paper 003 by simulation: modes of orientation, absolute and relative aerial control.

    python scripts/relative_control_modes.py --blocks 30 --out runs.json
        simulates and adjusts block 2015 and corridor 2014 with 30 seeds each (half an hour of work;
        `--jobs 2` halves it), appends to runs.json what was not there yet
    python scripts/relative_control_modes.py --blocks 30 --out runs.json --write benchmarks
        and writes aerial_control_modes.md and .png from it

Blocks are those of `insgnss simulate --flight block2015` and `corridor2014`. Errors of the poses
are 3.5 / 3.5 / 3 cm and 0.045 / 0.045 / 0.125 deg, 75 % of the variance for 300 s. Each block is
adjusted in the eight modes of Table 3, relative control weighed by the whole covariance
("smoothed"), by equation 5 ("independent") and by equation 6 ("gyro"), and once more with a
bore-sight that nobody told.
"""

import argparse
import json
import tempfile
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

import aerial_control_cases as cases
import numpy as np
from scipy.stats import chi2

from insgnss.simulation.published_blocks.plans import SURVEYS

RELATIVE = tuple(mode for mode in cases.MODES if "Ra" in mode)
ABSOLUTE = ("ISO Ap Aa", "F. AT Ap Aa")
WEIGHTS = ("independent", "gyro")
PLAIN, RESIDUAL, UNKNOWN, WHITE = "plain", "residual bore-sight", "unknown bore-sight", "white"
EXPERIMENTS = (  # name, bore-sight in deg, share of the variance that lasts
    (PLAIN, 0.0, 0.75),
    (RESIDUAL, 0.1, 0.75),
    (UNKNOWN, 1.5, 0.75),
    (WHITE, 0.0, 0.0),
)
FAST_AT = ("F. AT Ap Aa", "F. AT Ap Ra", "F. AT Rp Ra")
FAST = (*FAST_AT, "DiSO")
HELD, ESTIMATED = "held", "estimated"
MISPRINT = ("corridor2014", "Indirect SO")


def main() -> None:
    """Run what is missing, print the tables, write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--blocks", type=int, default=30, help="seeds of each data set")
    few = (
        "of block 2015 so many with tie points too, the rest in modes that take none (default: 12)"
    )
    parser.add_argument("--integrated", type=int, default=12, help=few)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--only", choices=cases.BLOCKS, help="one of the data sets")
    parser.add_argument("--out", type=Path, default=Path("relative_control_modes.json"))
    parser.add_argument("--write", type=Path, metavar="DIR", help="where the page goes")
    options = parser.parse_args()
    rows = json.loads(options.out.read_text()) if options.out.exists() else []
    there = {(row["block"], row["seed"]) for row in rows}
    seeds = range(options.first_seed, options.first_seed + options.blocks)
    blocks = [options.only] if options.only else cases.BLOCKS
    wanted = [
        (b, s, b != "block2015" or s - options.first_seed < options.integrated)
        for s in seeds
        for b in blocks
        if (b, s) not in there
    ]
    with ProcessPoolExecutor(options.jobs) as pool:
        for (block, seed, _), made in zip(wanted, pool.map(one, wanted), strict=True):
            rows += made
            options.out.write_text(json.dumps(rows))
            print(f"{block}, seed {seed}: {len(made)} adjustments", flush=True)
    rows = [row for row in rows if row["seed"] in seeds and row["block"] in blocks]
    for block in blocks:
        print(table([row for row in rows if row["block"] == block], block))
        print(weightings([row for row in rows if row["block"] == block]))
        print(bore_sights([row for row in rows if row["block"] == block]))


def one(key: tuple[str, int, bool]) -> list[dict]:
    """Simulate a block, and adjust it in all ways; or in those without tie points."""
    block, seed, integrated = key
    rows = []
    for name, turn, share in EXPERIMENTS:
        errors = replace(SURVEYS[block].errors, share=share)
        made = cases.simulate_survey(block, seed, boresight_deg=turn, errors=errors)
        with tempfile.TemporaryDirectory() as directory:
            file = cases.written(Path(directory) / block, made)
            for mode, weights, boresight in ways_of(name):
                sigma = 3.0 if boresight == ESTIMATED else 0.0
                wanted = cases.in_mode(file, mode, weights, sigma)
                if mode not in FAST and not integrated:
                    continue
                found = cases.outcome(wanted, made)
                rows.append(
                    {
                        **{"block": block, "seed": seed, "experiment": name, "mode": mode},
                        **{"weights": weights, "boresight": boresight},
                        "rms": np.sqrt((found.difference_m**2).mean(axis=0)).tolist(),
                        "mean": found.difference_m.mean(axis=0).tolist(),
                        "formal": np.sqrt((found.sigma_m**2).mean(axis=0)).tolist(),
                        "points": len(found.difference_m),
                        "normalised": found.normalised,
                        "poses": found.poses,
                        "promised": found.promised_m.tolist(),
                        "actual": found.actual_m.tolist(),
                        "neighbours": found.neighbours,
                    }
                )
    return rows


def ways_of(experiment: str) -> list[tuple[str, str, str]]:
    """Return mode, weights and what is done with the bore-sight, for an experiment."""
    if experiment == WHITE:
        both = ("smoothed", "independent")
        return [(mode, weights, HELD) for mode in ("ISO Rp Ra", "F. AT Rp Ra") for weights in both]
    if experiment != PLAIN:
        both = ("smoothed", "independent")
        ways = [(mode, weights, HELD) for weights in both for mode in FAST_AT]
        return [*ways, *((FAST_AT[0], weights, ESTIMATED) for weights in both)]
    plain = [(mode, "smoothed", HELD) for mode in cases.MODES]
    plain += [(mode, "independent", HELD) for mode in ABSOLUTE]
    return plain + [(mode, weights, HELD) for weights in WEIGHTS for mode in RELATIVE]


def chosen(rows: list[dict], **wanted: object) -> list[dict]:
    """Return the rows with these values."""
    return [row for row in rows if all(row[key] == value for key, value in wanted.items())]


def rms(rows: list[dict], key: str) -> np.ndarray:
    """Return the root mean square of a column over blocks."""
    return np.sqrt(np.mean(np.square([row[key] for row in rows]), axis=0))


def three(values: np.ndarray, width: int = 5) -> str:
    """Return millimetres."""
    return " ".join(f"{1e3 * x:{width}.0f}" for x in values)


def paper(block: str, mode: str) -> tuple[np.ndarray, np.ndarray]:
    """Return published means and root mean squares, m; the misprint put right."""
    printed = np.array(cases.PUBLISHED[block][mode], dtype=float)
    if (block, mode) == MISPRINT:
        printed[5] *= 10.0
    return printed[:3] / 1e3, printed[3:] / 1e3


def table(rows: list[dict], block: str) -> str:
    """Return Table 4 beside the simulation."""
    lines = [
        "",
        f"{block}: check points E N U, mm",
        f"{'':12} {'rms':>17} {'promised':>17} {'|mean|':>17} {'paper: rms':>17} {'mean':>17}"
        f" {'horizontal':>10} {'larger':>6} {'points':>6} {'poses':>6}",
    ]
    for mode in cases.MODES:
        own = chosen(rows, experiment=PLAIN, mode=mode, weights="smoothed")
        mean, published = paper(block, mode)
        found = rms(own, "rms")
        across = [np.hypot(*row["rms"][:2]) for row in own]
        ratio = np.hypot(*found[:2]) / np.hypot(*published[:2])
        larger = np.mean(np.array(across) > np.hypot(*published[:2]))
        lines.append(
            f"{mode:12} {three(found)} {three(rms(own, 'formal'))} {three(rms(own, 'mean'))}"
            f" {three(published)} {three(mean)} {ratio:10.2f} {larger:6.0%}"
            f" {np.mean([row['normalised'] for row in own]):6.2f}"
            f" {np.mean([row['poses'] for row in own]):6.2f}"
        )
    return "\n".join(lines)


def weightings(rows: list[dict]) -> str:
    """Return what the three weightings promise."""
    n = len(chosen(rows, experiment=PLAIN, mode="ISO Ap Ra", weights="smoothed"))
    m = rows[0]["points"]
    low, high = chi2.ppf((0.005, 0.995), 3 * m * n) / (3 * m * n)
    lines = [
        f"\nweightings; normalised squares of check points, 99 % of chance {low:.2f} to {high:.2f}"
    ]
    for mode in (*ABSOLUTE, *RELATIVE):
        for weights in ("smoothed", *WEIGHTS)[: 2 if mode in ABSOLUTE else 3]:
            own = chosen(rows, experiment=PLAIN, mode=mode, weights=weights)
            promised, actual = rms(own, "promised"), rms(own, "actual")
            ratio = promised / actual
            lines.append(
                f"{mode:12} {weights:12} rms {three(rms(own, 'rms'))} promised"
                f" {three(rms(own, 'formal'))}  points"
                f" {np.mean([row['normalised'] for row in own]):5.2f} poses"
                f" {np.mean([row['poses'] for row in own]):5.2f} neighbours"
                f" {np.mean([row['neighbours'] for row in own]):5.2f}; relative position"
                f" {1e3 * promised[0]:.1f}/{1e3 * actual[0]:.1f} mm = {ratio[0]:.2f}, of ends"
                f" {1e3 * promised[1]:.1f}/{1e3 * actual[1]:.1f} mm = {ratio[1]:.2f}"
            )
    return "\n".join(lines)


def bore_sights(rows: list[dict]) -> str:
    """Return Fast AT with a bore-sight that nobody told, and relative control of white errors."""
    lines = ["\nFast AT with a bore-sight that the poses do not know, and poses with white errors"]
    for name, turn, _ in EXPERIMENTS:
        for mode, weights, boresight in ways_of(name if name == WHITE else UNKNOWN):
            own = chosen(rows, experiment=name, mode=mode, weights=weights, boresight=boresight)
            if own:
                ratio = rms(own, "promised") / rms(own, "actual")
                lines.append(
                    f"{name:19} {turn:4.1f} deg {mode:12} {weights:12} {boresight:10} rms"
                    f" {three(rms(own, 'rms'), 6)} promised {three(rms(own, 'formal'), 6)}"
                    f" points {np.mean([row['normalised'] for row in own]):5.2f} poses"
                    f" {np.mean([row['poses'] for row in own]):5.2f} relative {ratio[0]:.2f}"
                    f" {ratio[1]:.2f}"
                )
    return "\n".join(lines)


if __name__ == "__main__":
    main()
