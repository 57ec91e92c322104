"""Emulated flights: trajectories that a drone flew, sensors that are simulated on them, errors that
are known.

The trajectories are those of the R package navigationdata of the SMAC group (a small fixed wing
near Lausanne, 100 Hz, position and attitude; not shipped). Their spline is the truth
(`insgnss.simulation.emulate`); an IMU at 100 Hz reads it with the errors of Table 5 of paper 000,
or with those that an ADIS16405 recorded at rest (imudata, likewise not shipped; the mean of every
stretch taken off), and fixes at 10 Hz err by 2, 2, 3 cm. Each flight is written as a data set and
processed from its files; verdicts and bounds are those of `fault_campaign.py`.

    python scripts/emulated_flights.py --recordings ../shared/data --write

RECORDINGS holds epfl_uav_trajectories/example_N_traj_ellipsoidal.RData (read by the package rdata)
and adis16405_static/*.npy.
"""

import argparse
import tempfile
import time
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
from emulate import Emulation, add_recorded_noise, emulate_motion
from fault_campaign import (
    ERROR_RATE,
    Case,
    Run,
    Verdict,
    conclude,
    confirmed_share,
    draw,
    run_flight,
)

from insgnss.navigation.noise_model.model import AxisNoise, GaussMarkov, NoiseModel
from insgnss.records import Array
from insgnss.simulation.dataset import write_simulated
from insgnss.simulation.scenario import SimulatedFlight, observe
from insgnss.simulation.sensors import ImuOptions

PAGE = Path(__file__).parents[1] / "benchmarks" / "emulated_flights.md"
TRACKS = (1, 2, 3)
SENSORS = (1, 2, 3, 5)  # the fourth recording holds a knock
UNITS = np.array([np.radians(0.05)] * 3 + [0.00333 * 9.80665] * 3)  # of a count
ADIS = NoiseModel(
    "adis16405",
    "Allan deviation of the recordings: at 1 s the white noise, at 100 s over 0.62 the Gauss-Markov"
    " process of 100 s",
    (AxisNoise(white_noise=7.5e-4, gauss_markov=(GaussMarkov.from_sigma(100.0, 2.3e-4),)),) * 3,
    (AxisNoise(white_noise=6.5e-3, gauss_markov=(GaussMarkov.from_sigma(100.0, 5.5e-3),)),) * 3,
)


def read_track(recordings: Path, number: int) -> Emulation:
    """The spline through one of the trajectories."""
    import rdata

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of rdata, about attributes that it does not know
        (table,) = rdata.read_rda(
            recordings / f"epfl_uav_trajectories/example_{number}_traj_ellipsoidal.RData"
        ).values()
    t, lat, lon, height, *rpy = np.asarray(table, dtype=np.float64).T
    return emulate_motion(205200.0 + t, lat, lon, height, np.stack(rpy, axis=-1))


def static_noise(recordings: Path, n: int, seed: int) -> Array:
    """(n, 6) rad/s and m/s^2: a stretch of a recording at rest without its mean; every seed another
    one.
    """
    counts = np.load(
        recordings / f"adis16405_static/adis_16405_imu{SENSORS[seed % len(SENSORS)]}.npy",
        mmap_mode="r",
    )
    first = 50_000 + (seed // len(SENSORS)) * 100_000
    part = counts[first : first + n] * UNITS
    return np.asarray(part - part.mean(axis=0))


def observed(emulation: Emulation, noise: Path | None, seed: int) -> SimulatedFlight:
    """What the sensors record, with Table 5 noise or with that of the recordings below `noise`."""
    flight = emulation.flight()
    if noise is None:
        return observe(flight, seed, imu=ImuOptions(100.0))
    simulated = observe(flight, seed, imu=ImuOptions(100.0, None))
    imu = add_recorded_noise(simulated.imu, static_noise(noise, simulated.imu.time.size, seed))
    return replace(simulated, imu=imu, imu_options=ImuOptions(100.0, ADIS))


def fly(emulation: Emulation, noise: Path | None, seed: int) -> Run:
    """Write one flight, process it from its files, and judge it."""
    began = time.perf_counter()
    with tempfile.TemporaryDirectory() as directory:
        return run_flight(
            write_simulated(
                Path(directory) / "flight", observed(emulation, noise, seed), seed=seed
            ),
            began,
        )


def page(verdicts: list[Verdict], tracks: dict[int, Emulation], runs: int) -> str:
    """The page of the docs."""
    lines = [
        "# Emulated flights",
        "",
        (
            "Written by `python scripts/emulated_flights.py --recordings DIR --write`, which says"
            f" how it is done; {runs} realisations of each"
        ),
        "flight. Columns and verdicts as in [fault_campaign.md](fault_campaign.md).",
        "",
        (
            "| flight | done / stopped / defect | position rms | attitude rms | mean squared z |"
            " worst image | verdict |"
        ),
        "|---|---|---|---|---|---|---|",
        *(verdict.row() for verdict in verdicts),
        "",
        (
            "The splines follow the trajectories to (rms north, east, down in mm; roll, pitch, yaw"
            " in deg):"
        ),
        "",
    ]
    for number, track in tracks.items():
        position, angle = 1e3 * track.position_rms_m, np.degrees(track.attitude_rms_rad)
        lasting = track.motion.end - track.motion.start
        lines.append(
            f"- trajectory {number}, {lasting:.0f} s: {position.round(1).tolist()};"
            f" {angle.round(3).tolist()}"
        )
    return "\n".join([*lines, "", "![mean squared z](emulated_flights.png)"]) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(
        description="Process emulated flights and judge their standard deviations"
    )
    parser.add_argument("--recordings", type=Path, required=True)
    parser.add_argument(
        "--runs", type=int, default=8, help="realisations of each flight, two at least"
    )
    parser.add_argument(
        "--write", action="store_true", help=f"write {PAGE.name} and its figure into benchmarks/"
    )
    options = parser.parse_args()
    tracks = {number: read_track(options.recordings, number) for number in TRACKS}
    verdicts = []
    for what, noise in (
        ("Table 5 noise", None),
        ("recorded noise of ADIS16405", options.recordings),
    ):
        every = [
            [fly(track, noise, seed) for seed in range(options.runs)] for track in tracks.values()
        ]
        share = confirmed_share([runs for runs in every if all(run.exit == "done" for run in runs)])
        verdicts += [
            conclude(Case(f"trajectory {number}, {what}"), runs, share)
            for number, runs in zip(tracks, every, strict=True)
        ]
        print("share of the effective samples that is confirmed:", share.round(2), flush=True)
        print("\n".join(verdict.row() for verdict in verdicts[-len(every) :]), flush=True)
    if options.write:
        PAGE.write_text(page(verdicts, tracks, options.runs), encoding="utf-8", newline="\n")
        draw(verdicts, PAGE.with_suffix(".png"))
    failed = [verdict.case.name for verdict in verdicts if not verdict.word.startswith("covered")]
    assert not failed, f"not covered at {100 * ERROR_RATE:g} %: {'; '.join(failed)}"


if __name__ == "__main__":
    main()
