"""Good flights: does `insgnss.estimate` accept whatever is right, with honest sigmas?

Simulated recordings of eight kinds of motion (a block, a corridor, circles at 30 and at 45 deg of
bank, a multirotor that flies sideways or backwards, one that hovers for minutes, a car, a walk)
are drawn at random: latitude, IMU rate, the IMU's axes (of 24), noise model (of those shipped),
sigma, rate and correlation of the fixes, with a barometer or without. The flight file is right in
all of them: it says what the simulator does. Time-correlated errors of the fixes are said by
`gnss.gm_sigma` and its neighbours (`stated`), or by their quality, single, whose errors the package
takes to stay for ten minutes (`quality`).

z is the error of a component of the trajectory (position, velocity and attitude, north, east,
down) over its sigma, at 1 Hz, and q the mean of z^2 over a flight. Errors of one flight are
correlated, so q scatters as the mean of n_eff < n squares would,

    n_eff = n^2 / sum_ij r(i - j)^2,    var q = 2 / n_eff                                      (D.1)

with r the autocorrelation of z about zero in that flight. The scatter of q over the flights says
how much of that is true: where 2 mean(q)^2 / var(q) is smaller than the mean n_eff, all n_eff are
lowered by that ratio. The mean of q over the flights must lie in the two-sided 99 % bounds of chi-
square with n_eff degrees for each flight, on each axis (Bonferroni over the nine), weights n_eff.
No flight may be refused, and no error may be beyond 5 sigma.

    python scripts/good_flights.py --write
        64 flights, the page into benchmarks/
    python scripts/good_flights.py --flights 8 --first 3
        some of them, to the screen; --only hover those of one motion
"""

import argparse
import os
import textwrap
import time
import traceback
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # matrices of 30 x 30

import numpy as np
from air_motions import circles, multirotor
from scipy.stats import chi2

import insgnss
from insgnss.geodesy.axes import axes_words
from insgnss.geodesy.earth import curvature_radii
from insgnss.geodesy.frames import LocalFrame
from insgnss.geodesy.rotation import right_angle_rotations, vector_from_rotation
from insgnss.records.qualities import Quality
from insgnss.simulation.flights import FlightMotion, fly
from insgnss.simulation.ground import drive, walk
from insgnss.simulation.layout import PLANS
from insgnss.simulation.motion import ExactMotion
from insgnss.simulation.raw_gnss.receiver import GnssOptions
from insgnss.simulation.scenario import SimulatedFlight, observe
from insgnss.simulation.sensors import ImuOptions

PAGE = Path(__file__).parents[1] / "benchmarks" / "good_flights.md"
NAMES = ("N", "E", "D", "v N", "v E", "v D", "psi N", "psi E", "psi D")
FLIGHTS, ERROR_RATE, WORST = 64, 0.01, 5.0
SEPARATOR = " // "  # of headline and notes
MOTIONS = (
    *("block", "corridor", "circles 30", "circles 45"),
    *("sideways", "backward", "hover", "car", "walk"),
)
RATES_HZ, FIX_RATES_HZ = (50.0, 100.0, 200.0, 500.0, 1000.0), (1.0, 2.0, 5.0, 10.0, 20.0)
MODELS = ("navchip", "tactical", "consumer")
SMALLEST_M, LARGEST_M, FLOOR_M = 0.005, 2.0, 4.0 / 3.0
WHITE, CODE_WHITE, CODE_TIME_S = 0.4, 0.3, 600.0  # share of stated, and of code; s
CORRELATIONS = ("white", "white", "stated", "quality")  # quality: of code-class fixes alone


@dataclass(frozen=True)
class Draw:
    """What was drawn for a flight; sigma_m is horizontal, the vertical one 1.5 times it."""

    number: int
    motion: str
    minutes: float
    latitude: float
    rate_hz: float
    axes: str
    noise: str
    sigma_m: float
    fix_rate_hz: float
    errors: str
    correlation_time_s: float
    velocities: bool
    barometer: bool

    def __str__(self) -> str:
        """In one line."""
        how = self.errors
        if self.errors == "stated":
            how += f" {self.correlation_time_s:.0f} s"
        more = ", velocities" * self.velocities + ", barometer" * self.barometer
        return (
            f"{self.number} {self.motion}, {self.minutes:.1f} min, {self.latitude:+.0f} deg,"
            f" {self.noise} at {self.rate_hz:g} Hz, {self.axes}, fixes {100 * self.sigma_m:.3g} cm"
            f" {how} at {self.fix_rate_hz:g} Hz{more}"
        )


@dataclass(frozen=True)
class Run:
    """How a flight ended; z (n, 9), psi about north, east, down; said: notes and headline."""

    draw: Draw
    refused: str = ""
    z: np.ndarray = field(default_factory=lambda: np.zeros((0, 9)))
    rms: np.ndarray = field(default_factory=lambda: np.full(9, np.nan))
    said: str = ""
    seconds: float = 0.0

    @property
    def q(self) -> np.ndarray:
        """(9,) mean of z^2."""
        return np.mean(self.z**2, axis=0)

    @property
    def n_eff(self) -> np.ndarray:
        """(9,) by (D.1)."""
        return np.array([effective(column) for column in self.z.T])


def effective(z: np.ndarray) -> float:
    """Number of independent squares in the mean of z^2 (D.1)."""
    n = z.size
    r = np.correlate(z, z, "full")[n - 1 :] / np.arange(n, 0, -1)
    r = r[: max(n // 2, 1)] / r[0]
    pairs = np.arange(n, n - r.size, -1)
    return float(n**2 / (n + 2.0 * np.sum(pairs[1:] * r[1:] ** 2)))


def drawn(number: int) -> Draw:
    """The flight of a number: motions in turn, everything else at random."""
    rng = np.random.default_rng([number, 64])
    sigma = float(np.exp(rng.uniform(np.log(SMALLEST_M), np.log(LARGEST_M))))
    errors = str(rng.choice(CORRELATIONS))
    if errors == "quality" and sigma < FLOOR_M:  # below it the package's floors raise them
        errors = "stated"
    C = right_angle_rotations()
    return Draw(
        number,
        MOTIONS[number % len(MOTIONS)],
        round(float(rng.uniform(3.0, 6.0)), 1),
        round(float(rng.uniform(-70.0, 70.0)), 1),
        float(rng.choice(RATES_HZ)),
        axes_words(C[int(rng.integers(len(C)))]),
        str(rng.choice(MODELS)),
        sigma,
        float(rng.choice(FIX_RATES_HZ)),
        errors,
        CODE_TIME_S if errors == "quality" else float(np.round(np.exp(rng.uniform(2.3, 5.3)))),
        bool(rng.random() < 0.3),
        bool(rng.random() < 0.3),
    )


def flown(draw: Draw) -> FlightMotion:
    """The motion, moved to its latitude."""
    seed, minutes = draw.number, draw.minutes
    if draw.motion in ("block", "corridor"):
        plan = PLANS["ign8" if draw.motion == "block" else "ign6x1"]
        flight = fly(plan.changed(minutes=minutes, start_in_air=seed % 2 == 0), seed)
    elif draw.motion.startswith("circles"):
        flight = circles(minutes, seed=seed, bank_deg=float(draw.motion.split()[1]))
    elif draw.motion in ("sideways", "backward", "hover"):
        flight = multirotor(minutes, draw.motion, seed=seed)
    else:
        flight = (drive if draw.motion == "car" else walk)(minutes, seed=seed)
    frame = LocalFrame(np.radians(draw.latitude), flight.motion.frame.lon, 300.0)
    motion = flight.motion
    moved = ExactMotion(frame, motion.start, motion.spacing, motion.control)
    return replace(flight, motion=moved)


def recorded(draw: Draw) -> SimulatedFlight:
    """What the sensors say."""
    sigma = np.array([1.0, 1.0, 1.5]) * draw.sigma_m
    velocity = (0.03, 0.03, 0.05) if draw.velocities else None
    options: dict[str, Any] = {"sigma_m": tuple(sigma)}
    if draw.errors != "white":
        white = CODE_WHITE if draw.errors == "quality" else WHITE
        options = {
            "sigma_m": tuple(white * sigma),
            "correlated_sigma_m": tuple(sigma),
            "correlation_time_s": draw.correlation_time_s,
        }
    receiver = GnssOptions(draw.fix_rate_hz, velocity_sigma_ms=velocity, **options)
    imu = ImuOptions(draw.rate_hz, draw.noise, draw.axes)
    sim = observe(flown(draw), draw.number, imu=imu, gnss=receiver, truth_hz=1.0)
    n = sim.gnss.time.size
    cov = np.broadcast_to(np.diag(sigma**2), (n, 3, 3)).copy()
    single = np.full(n, Quality.SINGLE) if draw.errors == "quality" else None
    return replace(sim, gnss=replace(sim.gnss, cov_ned=cov, quality=single))


def heights(sim: SimulatedFlight, draw: Draw) -> insgnss.BarometerHeights | None:
    """Heights of a barometer with the errors that an empty table [barometer] states."""
    if not draw.barometer:
        return None
    rng = np.random.default_rng([draw.number, 65])
    true, n = sim.truth.trajectory, len(sim.truth.trajectory.time)
    scale, walk_m = 1.0 + 0.05 * rng.standard_normal(), np.cumsum(0.1 * rng.standard_normal(n))
    level = rng.uniform(-300.0, 300.0) + 0.5 * rng.standard_normal(n)
    height = scale * true.height + level + walk_m
    return insgnss.BarometerHeights(true.time, height, true.gps_week)


def estimated(sim: SimulatedFlight, draw: Draw) -> insgnss.ProcessResult:
    """The result, with a flight file that says what was simulated."""
    changes: dict[str, Any] = {}
    if draw.errors == "stated":
        changes = {
            "gnss__gm_sigma": 1.0,
            "gnss__correlation_time_s": draw.correlation_time_s,
            "gnss__white_scale": WHITE,
        }
    return insgnss.estimate(
        *(sim.imu, sim.gnss, sim.events),
        barometer=heights(sim, draw),
        mounting=sim.mounting,
        noise=draw.noise,
        imu_axes=draw.axes,
        trajectory_hz=1.0,
        **changes,
    )


def run(number: int) -> Run:
    """Simulate, estimate, compare."""
    draw, began = drawn(number), time.perf_counter()
    sim = recorded(draw)
    try:
        result = estimated(sim, draw)
    except insgnss.InsgnssError as refusal:
        return Run(draw, str(refusal), seconds=time.perf_counter() - began)
    except Exception as error:  # whatever is no error of the package is a defect
        where = traceback.extract_tb(error.__traceback__)[-1]
        return Run(draw, f"{type(error).__name__} in {where.name}: {error}")
    error, sigma = compared(sim, result)
    noted = [f"{c.name}: {c.found}" for c in result.checks if c.verdict != "ok"]
    said = SEPARATOR.join([result.report["headline"], *noted])
    rms, seconds = np.sqrt(np.mean(error**2, axis=0)), time.perf_counter() - began
    return Run(draw, "", error / sigma, rms, said, seconds)


def compared(sim: SimulatedFlight, result: insgnss.ProcessResult) -> tuple[np.ndarray, np.ndarray]:
    """Truth minus estimate (n, 9) in m, m/s, rad, north east down, and its sigmas."""
    true, own = sim.truth.trajectory, result.trajectory
    own = own[(own.time >= true.time[0]) & (own.time <= true.time[-1])]
    motion, time_s = sim.flight.motion, own.time
    lat, lon, height = motion.geodetic(time_s)
    meridian, normal = curvature_radii(own.lat)
    C_nl = motion.C_nl(time_s)
    velocity = np.einsum("nij,nj->ni", C_nl, motion.velocity(time_s))
    psi = vector_from_rotation(C_nl @ motion.C_lb(time_s) @ np.swapaxes(own.C_nb, 1, 2))
    position = np.column_stack(
        [
            (lat - own.lat) * (meridian + own.height),
            (lon - own.lon) * (normal + own.height) * np.cos(own.lat),
            own.height - height,
        ]
    )
    sigma = np.sqrt(np.diagonal(own.cov, axis1=1, axis2=2))
    return np.hstack([position, velocity - own.velocity_ned, psi]), sigma


@dataclass(frozen=True)
class Statistics:
    """Of all flights, (9,) each: mean q, its bounds, degrees of freedom, confirmed share, worst."""

    q: np.ndarray
    low: np.ndarray
    high: np.ndarray
    n_eff: np.ndarray
    share: np.ndarray
    worst: np.ndarray


def statistics(runs: Sequence[Run]) -> Statistics:
    """Mean squares over the flights, and their bounds (D.1)."""
    q, n_eff = np.array([r.q for r in runs]), np.array([r.n_eff for r in runs])
    scatter = 2.0 * q.mean(axis=0) ** 2 / q.var(axis=0, ddof=1)
    share = np.minimum(1.0, scatter / n_eff.mean(axis=0))
    n_eff *= share
    total, tail = n_eff.sum(axis=0), 0.5 * ERROR_RATE / len(NAMES)
    low, high = (chi2.ppf(p, total) / total for p in (tail, 1.0 - tail))
    worst = np.max([np.abs(r.z).max(axis=0) for r in runs], axis=0)
    return Statistics((n_eff * q).sum(axis=0) / total, low, high, total, share, worst)


def line(one: Run) -> str:
    """A flight to the screen."""
    if one.refused:
        return f"REFUSED {one.draw}: {one.refused}"
    q = " ".join(f"{value:.2f}" for value in one.q)
    word = "ok     " if np.abs(one.z).max() < WORST else "BEYOND "
    return (
        f"{word} {one.draw}: worst {np.abs(one.z).max():.1f} in"
        f" {NAMES[int(np.abs(one.z).max(axis=0).argmax())]}, q {q}, rms N {one.rms[0]:.3g} m,"
        f" psi D {np.degrees(one.rms[8]):.2g} deg, {one.seconds:.0f} s; {one.said}"
    )


def page(runs: Sequence[Run]) -> str:
    """The page of the docs."""
    solved = [one for one in runs if not one.refused]
    s = statistics(solved)
    beyond = [one for one in solved if np.abs(one.z).max() >= WORST]
    table = [
        "| axis | mean square | 99 % bounds | degrees of freedom | worst |",
        "|---|---|---|---|---|",
        *(
            f"| {name} | {s.q[k]:.2f} | {s.low[k]:.2f} to {s.high[k]:.2f} | {s.n_eff[k]:.0f} |"
            f" {s.worst[k]:.1f} |"
            for k, name in enumerate(NAMES)
        ),
    ]
    by_flight = [
        "| flight | mean square of position / velocity / attitude | worst | rms position |"
        " heading | noted |",
        "|---|---|---|---|---|---|",
    ]
    for one in runs:
        if one.refused:
            reason = textwrap.shorten(one.refused.replace("|", "/"), 160, placeholder=" ...")
            by_flight.append(f"| {one.draw} | refused | | | | {reason} |")
            continue
        q = one.q.reshape(3, 3).mean(axis=1)
        noted = ", ".join(part.split(":")[0] for part in one.said.split(SEPARATOR)[1:])
        by_flight.append(
            f"| {one.draw} | {q[0]:.2f} / {q[1]:.2f} / {q[2]:.2f} | {np.abs(one.z).max():.1f} |"
            f" {100 * np.linalg.norm(one.rms[:3]):.2g} cm | {np.degrees(one.rms[8]):.2g} deg |"
            f" {noted} |"
        )
    return "\n".join(
        [
            "# Good flights",
            "",
            "Written by `python scripts/good_flights.py --write`, which says how it is done.",
            "",
            f"{len(runs)} flights whose flight file is right: {len(runs) - len(solved)} refused,"
            f" {len(beyond)} with an error of {WORST:g} sigmas or more.",
            "",
            *table,
            "",
            *by_flight,
            "",
        ]
    )


def main() -> None:
    """Fly, judge, print, write."""
    parser = argparse.ArgumentParser(description="Right flight files: accepted, and honest?")
    parser.add_argument("--flights", type=int, default=FLIGHTS)
    parser.add_argument("--first", type=int, default=0, help="number of the first flight")
    parser.add_argument("--only", default="", help="those whose motion holds this word")
    parser.add_argument("--write", action="store_true", help=f"write {PAGE.name} into benchmarks/")
    options = parser.parse_args()
    numbers = range(options.first, options.first + options.flights)
    runs = []
    for number in numbers:
        if options.only in MOTIONS[number % len(MOTIONS)]:
            runs.append(run(number))
            print(line(runs[-1]), flush=True)
    solved = [one for one in runs if not one.refused]
    if len(solved) > 1:
        s = statistics(solved)
        for k, name in enumerate(NAMES):
            print(
                f"{name:6} mean square {s.q[k]:.2f}, bounds {s.low[k]:.2f} to {s.high[k]:.2f},"
                f" {s.n_eff[k]:.0f} degrees, share {s.share[k]:.2f}, worst {s.worst[k]:.1f}"
            )
    if options.write:
        PAGE.write_text(page(runs), encoding="utf-8", newline="\n")
    bad = [one for one in runs if one.refused or np.abs(one.z).max() >= WORST]
    assert not bad, f"{len(bad)} of {len(runs)} flights refused or beyond {WORST:g} sigmas"
    if len(solved) >= FLIGHTS:  # fewer say little of the scatter from flight to flight
        s = statistics(solved)
        within = (s.low < s.q) & (s.q < s.high)
        off = [name for name, good in zip(NAMES, within, strict=True) if not good]
        assert not off, f"mean squares beyond their bounds: {', '.join(off)}"


if __name__ == "__main__":
    main()
