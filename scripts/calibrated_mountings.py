"""Mountings of simulated flights, calibrated by the poses of their blocks, against the truth.

    python scripts/calibrated_mountings.py --flight ign8 --flights 30
    python scripts/calibrated_mountings.py --flight ign6x1 --flights 20 --own-frame

Each flight has seeds of its own. Its file has no bore-sight (the true one is -0.657, 0.574, -0.513
deg), a lever arm that is 5, -4 and 6 cm off and a camera delay that is 17 ms off; the poses of the
block have errors of 1 cm and 0.003 deg, which the calibration is not told. The table has, over all
flights, formal over actual standard deviations of each component and the mean normalised square of
bore-sight, antenna and delay jointly, with the bounds of chi-square (99 %); the same of the longest
flight line alone, and which components were determined.
"""

import argparse
import os
import tempfile
from collections import Counter
from dataclasses import dataclass, field, replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # on a shared machine more threads only spin

import numpy as np
from scipy.stats import chi2

WRONG_M, DELAY_S = np.array([0.05, -0.04, 0.06]), 0.017
NOISE_M, NOISE_RAD = 0.01, np.radians(0.003)
NAMES = (
    *(f"bore-sight about {axis}, deg" for axis in "xyz"),
    *(f"antenna {axis}, mm" for axis in "xyz"),
    *(f"IMU {axis}, mm" for axis in "xyz"),
    "delay, ms",
)
UNITS = np.array([np.degrees(1.0)] * 3 + [1e3] * 7)
JOINT = [0, 1, 2, 3, 4, 5, 9]


@dataclass
class Tally:
    """What all flights say together."""

    errors: list[np.ndarray] = field(default_factory=list)
    sigmas: list[np.ndarray] = field(default_factory=list)
    squares: list[float] = field(default_factory=list)
    verdicts: Counter[tuple[str, str]] = field(default_factory=Counter)


def main() -> None:
    """Fly, calibrate, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--flight", choices=("ign8", "ign6x1"), default="ign8")
    parser.add_argument("--flights", type=int, default=30)
    parser.add_argument("--first-seed", type=int, default=300)
    parser.add_argument("--minutes", type=float, help="of each flight; by default its whole plan")
    own = "the block stands in a frame of its own, up to a similarity"
    parser.add_argument("--own-frame", action="store_true", help=own)
    options = parser.parse_args()
    tallies = {"all images": Tally(), "the longest line": Tally()}
    for k in range(options.flights):
        with tempfile.TemporaryDirectory() as directory:
            calibrate(Path(directory) / "flight", options, options.first_seed + k, tallies)
        tally = tallies["all images"]
        print(
            f"flight {k + 1} of {options.flights}: {tally.squares[-1] / len(JOINT):.2f}", flush=True
        )
    for name, tally in tallies.items():
        table(f"{options.flight}, {options.flights} flights, {name}", tally)


def calibrate(
    directory: Path, options: argparse.Namespace, seed: int, tallies: dict[str, Tally]
) -> None:
    """Fly one flight, calibrate it with all images and with one line."""
    from insgnss.flight.config.load import load_flight
    from insgnss.flight.processing.pipeline import process
    from insgnss.geodesy.rotation import rotation_from_vector
    from insgnss.photogrammetry.mounting_calibration.judgement import components
    from insgnss.photogrammetry.mounting_calibration.options import Assumptions
    from insgnss.photogrammetry.mounting_calibration.records import (
        CameraPoses,
        CovariantPoses,
        Stated,
    )
    from insgnss.photogrammetry.mounting_calibration.solution import solve
    from insgnss.simulation.dataset import write_dataset
    from insgnss.simulation.sensors import Rig

    rig = Rig()
    wrong = {
        "mounting": {
            "antenna_m": list(np.array(rig.antenna_m) + WRONG_M),
            "antenna_sigma_m": 0.05,
            "boresight": np.eye(3).tolist(),
        },
        "camera": {"time_offset_s": -DELAY_S},
    }
    write_dataset(
        directory, options.flight, options.minutes, imu_rate=100.0, seed=seed, flight_file=wrong
    )
    flight = load_flight(directory)
    changed = replace(
        flight,
        filter=replace(flight.filter, lever_arm=True, lever_arm_sigma_m=0.3),
        output=replace(flight.output, strip_covariance=True),
    )
    result = process(changed, write=False)
    with np.load(directory / "truth/eo.npz") as file:
        row = {str(name): k for k, name in enumerate(file["images"])}
        rows = [row[name] for name in result.eo.images]
        X, C = file["position_enu"][rows], file["C_mc"][rows]
    rng = np.random.default_rng(seed + 7)
    X = X + NOISE_M * rng.standard_normal(X.shape)
    C = rotation_from_vector(NOISE_RAD * rng.standard_normal(X.shape)) @ C
    if options.own_frame:
        R = rotation_from_vector(np.array([0.3, -1.0, 2.0]))
        X, C = 0.02 * (X - X.mean(axis=0)) @ R.T + 5.0, R @ C
    independent = np.zeros((6, 6))  # errors that images share in camera axes: there are none
    frame = "own" if options.own_frame else "plane"
    block = CameraPoses(result.eo.images, X, C, None, frame, shared=independent)
    posed = CovariantPoses(result.eo, result.strips, result.common, flight.mounting, -DELAY_S)
    stated = Stated(flight.mounting, -DELAY_S)
    every = np.arange(len(X))
    solved = solve(block, posed, every, Assumptions())
    line = max((own.rows for own in solved.lines), key=len)
    alone = solve(block.taken(line), posed, line, Assumptions())
    for tally, one in zip(tallies.values(), (solved, alone), strict=True):
        e, P = errors(one, rig)
        tally.errors.append(e)
        tally.sigmas.append(np.sqrt(np.diag(P)))
        tally.squares.append(float(e[JOINT] @ np.linalg.solve(P[np.ix_(JOINT, JOINT)], e[JOINT])))
        for component in components(one, stated):
            tally.verdicts[component.name, component.verdict] += 1


def errors(solved: object, rig: object) -> tuple[np.ndarray, np.ndarray]:
    """Return true minus found, bore-sight, antenna, IMU, delay (10,), and its covariance."""
    from insgnss.geodesy.rotation import vector_from_rotation
    from insgnss.photogrammetry.adjust.aerial import BORESIGHT, EXPOSURE_DELAY

    before = solved.flight.mounting
    true = before.camera_from_body @ np.array(rig.boresight)
    beta = vector_from_rotation(before.C_cb @ true.T @ solved.boresight_change.T)
    antenna, imu = solved.lever_arms()
    J = np.zeros((10, len(solved.cov)))
    J[:3, solved.place[BORESIGHT]] = np.eye(3)
    J[3:9] = solved.lever_arm_derivatives()
    J[9:, solved.place[EXPOSURE_DELAY]] = 1.0
    arms = np.array(rig.antenna_m) - antenna, np.array(rig.imu_m) - imu
    e = np.concatenate([beta, *arms, DELAY_S - solved.values[EXPOSURE_DELAY]])
    return e, J @ solved.cov @ J.T


def table(title: str, tally: Tally) -> None:
    """Print what all flights say together."""
    e, sigma = np.array(tally.errors), np.array(tally.sigmas)
    n = len(e)
    print(f"\n{title}")
    print(f"{'':<24}{'rms error':>12}{'formal':>12}{'formal/actual':>16}{'largest, sigma':>17}")
    actual = np.sqrt((e**2).mean(axis=0))
    formal = np.sqrt((sigma**2).mean(axis=0))
    ratio = 1.0 / np.sqrt(((e / sigma) ** 2).mean(axis=0))
    most = np.abs(e / sigma).max(axis=0)
    rows = zip(NAMES, actual * UNITS, formal * UNITS, ratio, most, strict=True)
    for name, a, f, r, m in rows:
        print(f"{name:<24}{a:12.4f}{f:12.4f}{r:16.2f}{m:17.1f}")
    degrees = len(JOINT) * n
    low, high = chi2.ppf((0.005, 0.995), degrees) / degrees
    mean = sum(tally.squares) / degrees
    print(f"mean normalised square {mean:.3f}, 99 % of chance: {low:.3f} to {high:.3f}")
    for (name, verdict), count in sorted(tally.verdicts.items()):
        print(f"  {name:<34}{verdict:<16}{count:4d} of {n}")


if __name__ == "__main__":
    main()
