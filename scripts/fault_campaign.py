"""Fault campaign: what becomes of a flight whose recording has a fault, and do the standard
deviations say so?

Short simulated block flights (stand, take-off, four lines of two levels, landing; 318 s, IMU of
Table 5 of paper 000 at 100 Hz, fixes of 2, 2, 3 cm at 10 Hz) are written as data sets, each with
one fault, and processed from their files as a user does. Every run ends in one of three ways: done,
stopped with a reason (an error of the package), or a traceback, which is a defect. The exterior
orientation of the images of a run that is done is compared with the truth.

Bounds. z is the error of a component (E, N, U, psi about E, N, U) over its standard deviation, q
the mean of z^2 over the images of a run. The images of a run share slow errors, so q has the
scatter of a mean of n_eff < n independent squares, var q = 2 / n_eff. The run's own covariances
give the correlation rho_ij of the errors of images i and j (neighbours' cross-covariances,
chained), hence

    n_eff = n^2 / sum_ij rho_ij^2                                                              (F.1)

and the scatter of q over the flights without a fault says how much of it is true: the ratio of 2
mean(q)^2 / var q to (F.1) is printed and applied where it is below one. The mean of q over the runs
of a case must not exceed the 99 % quantile of chi-square with the sum of their n_eff over that sum,
for six components together (Bonferroni). Besides, the six-dimensional normalised error squared of
the worst single image must not exceed the quantile that one of all images of the case exceeds in 1
% of cases, whatever their correlation.

    covered    both bounds hold ("wide": the lower bound of a component is broken, its standard
               deviations are larger than need be)
    stopped    every run stopped with a reason
    FAILED     a bound is broken, a traceback, or a data set that is refused for its flight file
    not covered, and why: a bound is broken by a fault that leaves no trace in the data; such cases
    are marked beforehand

Runs of a case that stop beside others that are covered are counted and the verdict is that of the
others.

    python scripts/fault_campaign.py --write
        all cases, table and figure into benchmarks/
    python scripts/fault_campaign.py --only latency --runs 2
        those whose name holds a word, to the screen
"""

import argparse
import os
import re
import tempfile
import textwrap
import time
import traceback
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # matrices of 30 x 30

import numpy as np
from scipy.stats import chi2

from insgnss import load_flight
from insgnss.base.errors import InsgnssError
from insgnss.flight.processing.pipeline import process
from insgnss.geodesy.rotation import vector_from_rotation
from insgnss.records import ExteriorOrientation
from insgnss.records.qualities import Quality
from insgnss.simulation.dataset import Dataset, write_dataset, write_simulated
from insgnss.simulation.faults import ImuFaults, RowFaults, Stuck, Vibration
from insgnss.simulation.ground import drive, walk
from insgnss.simulation.layout import BLOCK, Level
from insgnss.simulation.raw_gnss.receiver import FixEpisode, GnssOptions
from insgnss.simulation.scenario import observe
from insgnss.simulation.sensors import ImuOptions

PAGE = Path(__file__).parents[1] / "benchmarks" / "fault_campaign.md"
NAMES = ("E", "N", "U", "psi E", "psi N", "psi U")
ERROR_RATE = 0.01  # of a verdict on honest covariances
PLAN = BLOCK.changed(
    levels=(Level(90.0, 35.0, 2, 300.0), Level(100.0, 125.0, 2, 300.0)),
    launch=(-250.0, -120.0),
    ground_s=20.0,
    ground_after_s=10.0,
    lead_m=15.0,
)
LONG = BLOCK.changed(
    levels=(Level(140.0, 35.0, 4, 700.0),), start_in_air=True, minutes=4.0
)  # straight for the first 40 s


@dataclass(frozen=True)
class Case:
    """One fault: what `write_dataset` is to do, or a function of the seed that tells; `way` :
    `drive` or `walk` in place of a flight.

    runs : seeds, where they are not those of the command.
    beyond : why nothing in the data shows this fault.
    """

    name: str
    options: Mapping[str, Any] | Callable[[int], Mapping[str, Any]] = field(default_factory=dict)
    runs: int | None = None
    beyond: str = ""

    def of(self, seed: int) -> Mapping[str, Any]:
        """The options of one run."""
        return self.options(seed) if callable(self.options) else self.options


def gnss(**options: Any) -> dict[str, Any]:
    return {"gnss": GnssOptions(**options)}


def imu(**options: Any) -> dict[str, Any]:
    return {"imu_faults": ImuFaults(**options)}


def claims(**tables: Any) -> dict[str, Any]:
    return {"flight_file": tables}


def stuck(channel: str, value: float | None = None, start_s: float = 120.0) -> dict[str, Any]:
    return imu(stuck=(Stuck(channel, start_s, value),))


def episode(start_s: float, duration_s: float, **options: Any) -> FixEpisode:
    return FixEpisode(start_s, duration_s, **options)


ALL_SINGLE = {"quality": Quality.SINGLE, "sigma_m": (1.5, 1.5, 3.0), "correlation_time_s": 60.0}
TRUSTED = {"claim_m": (0.02, 0.02, 0.03)}
OUTLIERS = {"outlier_fraction": 0.05, "outlier_m": (1.0, 50.0)}
CORRELATED = {
    "sigma_m": (0.005, 0.005, 0.0075),
    "correlated_sigma_m": (0.02, 0.02, 0.03),
    "correlation_time_s": 60.0,
}

CASES = (
    Case("no fault", runs=24),
    Case("no fault, fixes at 1 Hz", gnss(rate_hz=1.0)),
    Case("outliers of 1-50 m, 5 %, 10 Hz", gnss(**OUTLIERS)),
    Case("outliers of 1-50 m, 5 %, 1 Hz", gnss(rate_hz=1.0, **OUTLIERS)),
    Case("outliers of 0.05-1 m, 5 %, 10 Hz", gnss(outlier_fraction=0.05, outlier_m=(0.05, 1.0))),
    Case(
        "outliers of 1-50 m, 5 %, 10 Hz, filter.robust",
        gnss(**OUTLIERS) | claims(filter={"robust": True}),
    ),
    Case("outage of 60 s, from the start", gnss(outages=((0.0, 60.0),))),
    Case("outage of 60 s, take-off", gnss(outages=((15.0, 60.0),))),
    Case("outage of 60 s, in a turn", gnss(outages=((77.0, 60.0),))),
    Case("outage of 60 s, on a line", gnss(outages=((105.0, 60.0),))),
    Case("outage of 60 s, last line", gnss(outages=((205.0, 60.0),))),
    Case("outage of 60 s, to the end", gnss(outages=((200.0, 200.0),))),
    Case(
        "outage of 60 s, anywhere (every 15 s)",
        lambda seed: gnss(outages=((15.0 * seed, 60.0),)),
        runs=18,
    ),
    Case("six IMU gaps of 0.5 s", imu(random_gaps=6)),
    Case("IMU gap of 0.5 s in a turn", imu(gaps=((105.0, 0.5),))),
    Case("IMU gap of 2 s on a line", imu(gaps=((130.0, 2.0),))),
    *(
        Case(f"latency {latency:+.2f} s", gnss(latency_s=latency))
        for latency in (-0.3, -0.1, -0.02, 0.02, 0.1, 0.3)
    ),
    *(
        Case(
            f"latency {latency:+.2f} s, filter.time_offset",
            gnss(latency_s=latency) | claims(filter={"time_offset": True}),
        )
        for latency in (-0.3, -0.1, -0.02, 0.02, 0.1, 0.3)
    ),
    Case("heading unknown: in the air, straight", {"flight": LONG}),
    Case("heading unknown, outliers", {"flight": LONG, **gnss(**OUTLIERS)}),
    Case("gyro x hangs from 120 s on", stuck("gyro x")),
    Case("gyro z hangs from 120 s on", stuck("gyro z")),
    Case("gyro y dead (0) all the time", stuck("gyro y", 0.0, 0.0)),
    Case("gyro z hangs for 3 s in a turn", imu(stuck=(Stuck("gyro z", 105.0, None, 3.0),))),
    Case("accelerometer x hangs from 120 s on", stuck("accel x")),
    Case("accelerometer z hangs from 120 s on", stuck("accel z")),
    Case("accelerometer y dead (0) all the time", stuck("accel y", 0.0, 0.0)),
    Case("lever arm 0.3 m wrong, forward", claims(mounting={"antenna_m": [0.762, -0.001, -0.065]})),
    Case("lever arm 0.3 m wrong, down", claims(mounting={"antenna_m": [0.462, -0.001, 0.235]})),
    *(
        Case(
            f"lever arm 0.3 m wrong, {way}, filter.lever_arm",
            claims(mounting={"antenna_m": place}, filter={"lever_arm": True}),
        )
        for way, place in (("forward", [0.762, -0.001, -0.065]), ("down", [0.462, -0.001, 0.235]))
    ),
    Case("specific force reversed", imu(reversed_accel=True)),
    Case(
        "axes exchanged: x and y",
        {"imu_axes": "right backward down", **claims(imu={"axes": "forward right down"})},
    ),
    Case(
        "axes exchanged: x and z",
        {"imu_axes": "down right backward", **claims(imu={"axes": "forward right down"})},
    ),
    Case(
        "axes turned by 180 deg about down",
        {"imu_axes": "backward left down", **claims(imu={"axes": "forward right down"})},
    ),
    Case("float for 60 s, proper sigmas", gnss(episodes=(episode(100.0, 60.0),))),
    Case("float for 60 s, claimed 2-3 cm", gnss(episodes=(episode(100.0, 60.0, **TRUSTED),))),
    Case("single for 60 s, proper sigmas", gnss(episodes=(episode(100.0, 60.0, **ALL_SINGLE),))),
    Case(
        "single for 60 s, claimed 2-3 cm",
        gnss(episodes=(episode(100.0, 60.0, **ALL_SINGLE, **TRUSTED),)),
    ),
    Case("correlated GNSS error, 60 s, claimed", gnss(**CORRELATED)),
    Case(
        "correlated GNSS error, 60 s, not claimed",
        gnss(**CORRELATED, claim_correlated=False),
        beyond="the IMU cannot see 2 cm a minute and the file says 5 mm",
    ),
    Case(
        "correlated GNSS error, 60 s, gnss.gm_sigma",
        gnss(**CORRELATED, claim_correlated=False)
        | claims(gnss={"gm_sigma": 4.0, "correlation_time_s": 60.0}),
    ),
    Case(
        "IMU rows: 0.5 % twice, 0.5 % out of order",
        {"imu_rows": RowFaults(duplicated=0.005, reordered=0.005)},
    ),
    Case(
        "GNSS rows: 0.5 % twice, 0.5 % out of order",
        {"gnss_rows": RowFaults(duplicated=0.005, reordered=0.005)},
    ),
    Case(
        "IMU and GNSS rows: 5 % out of order",
        {"imu_rows": RowFaults(reordered=0.05), "gnss_rows": RowFaults(reordered=0.05)},
    ),
    Case(
        "IMU rows: 1 % stamped up to 20 ms late",
        {"imu_rows": RowFaults(delayed=0.01, delay_s=0.02)},
    ),
    Case("GNSS in UTC as GPS time", gnss(latency_s=-18.0)),
    Case("IMU in UTC as GPS time", imu(clock_offset_s=-18.0)),
    Case("a car, outage of 60 s", {"way": drive, **gnss(outages=((120.0, 60.0),))}),
    Case(
        "a car, outage of 60 s, filter.non_holonomic",
        {"way": drive, **gnss(outages=((120.0, 60.0),)), **claims(filter={"non_holonomic": True})},
    ),
    Case(
        "a car on a road like glass, outage of 60 s",
        {"way": partial(drive, rough=0.0), **gnss(outages=((120.0, 60.0),))},
    ),
    Case("a walk, outliers of 1-50 m, 5 %", {"way": walk, **gnss(**OUTLIERS)}),
    Case("a walk, outage of 60 s", {"way": walk, **gnss(outages=((120.0, 60.0),))}),
    Case("engine vibration, 2 m/s^2 at 83 Hz", imu(vibration=Vibration())),
    Case(
        "engine vibration that aliases, 1 m/s^2 at 83 Hz",
        {"quantity": "instant_rate", **imu(vibration=Vibration(1.0, 0.01))},
    ),
)


@dataclass(frozen=True)
class Run:
    """How one flight ended: `exit` is "done", "stopped" or "defect"; z (n, 6), nees (n,), n_eff
    (6,) by (F.1), rms (6,) m and rad.
    """

    exit: str
    reason: str = ""
    z: np.ndarray = field(default_factory=lambda: np.zeros((0, 6)))
    nees: np.ndarray = field(default_factory=lambda: np.zeros(0))
    n_eff: np.ndarray = field(default_factory=lambda: np.zeros(6))
    rms: np.ndarray = field(default_factory=lambda: np.full(6, np.nan))
    seconds: float = 0.0

    @property
    def q(self) -> np.ndarray:
        """(6,) mean of z^2 over the images."""
        return np.mean(self.z**2, axis=0)


def fly(options: Mapping[str, Any], seed: int) -> Run:
    """Write one data set, process it from its files, and judge it."""
    began = time.perf_counter()
    with tempfile.TemporaryDirectory() as directory:
        if "way" in options:
            flown = options["way"](5.0, seed=seed)
            simulated = observe(flown, seed, imu=ImuOptions(100.0), gnss=options.get("gnss"))
            data = write_simulated(
                Path(directory) / "flight",
                simulated,
                seed=seed,
                flight_file=options.get("flight_file"),
            )
        else:
            data = write_dataset(
                Path(directory) / "flight",
                seed=seed,
                **{"flight": PLAN, "imu_rate": 100.0, **options},
            )
        return run_flight(data, began)


def run_flight(data: Dataset, began: float) -> Run:
    """Process a data set and judge the result; `began` : time.perf_counter() of its beginning."""
    try:
        flight = load_flight(data.flight_file)
    except InsgnssError as error:
        return Run("defect", f"flight file refused: {_short(str(error))}")
    try:
        result = process(flight)
    except InsgnssError as error:
        return Run(
            "stopped",
            f"{type(error).__name__}: {_short(str(error))}",
            seconds=time.perf_counter() - began,
        )
    except Exception as error:  # whatever is no error of the package is a defect
        where = traceback.extract_tb(error.__traceback__)[-1]
        return Run(
            "defect",
            f"{type(error).__name__} in {Path(where.filename).name}:{where.lineno}: {error}",
        )
    assert result.eo is not None
    return judge(result.eo, data.simulated.truth.eo, time.perf_counter() - began)


def _short(message: str) -> str:
    """A message without the directories before the file that it begins with."""
    return re.sub(r"^[^ :]*/", "", message)


def judge(eo: ExteriorOrientation, truth: ExteriorOrientation, seconds: float) -> Run:
    """Errors against the truth at the images that both have."""
    place = {image: k for k, image in enumerate(truth.images)}
    k = np.array([place[image] for image in eo.images])
    turn = vector_from_rotation(truth.C_mc[k] @ np.swapaxes(eo.C_mc, -1, -2))
    error = np.hstack([truth.position_m[k] - eo.position_m, turn])
    nees = np.einsum("ni,ni->n", error, np.linalg.solve(eo.cov, error[..., None])[..., 0])
    z = error / np.sqrt(np.diagonal(eo.cov, axis1=1, axis2=2))
    return Run(
        "done", "", z, nees, effective_samples(eo), np.sqrt(np.mean(error**2, axis=0)), seconds
    )


def effective_samples(eo: ExteriorOrientation) -> np.ndarray:
    """(6,) n_eff of (F.1); the covariance of images i < j is that of neighbours chained, C_ij =
    C_i,j-1 P_j-1^-1 C_j-1,j.
    """
    n = len(eo.images)
    sigma = np.sqrt(np.diagonal(eo.cov, axis1=1, axis2=2))
    step = np.linalg.solve(eo.cov[:-1], eo.cross)
    square = np.full(6, float(n))
    for i in range(n - 1):
        chained = eo.cov[i]
        for j in range(i, n - 1):
            chained = chained @ step[j]
            square += 2.0 * (np.diag(chained) / (sigma[i] * sigma[j + 1])) ** 2
    return n * n / square


def confirmed_share(cases: list[list[Run]]) -> np.ndarray:
    """(6,) how much of (F.1) the scatter of q confirms, at most one.

    Flights of a case differ by their seeds alone, so (q / mean q - 1)^2 n_eff / 2 has the mean (N -
    1) / N where (F.1) is right, and a larger one where images share more than neighbours tell. It
        is free of scale: sigmas that are all too small do not widen the bounds.
    """
    scatter = []
    for runs in cases:
        q, n_eff = np.array([run.q for run in runs]), np.array([run.n_eff for run in runs])
        scatter.append(
            (q / q.mean(axis=0) - 1.0) ** 2 * n_eff / 2.0 * len(runs) / (len(runs) - 1.0)
        )
    return np.minimum(1.0 / np.concatenate(scatter).mean(axis=0), 1.0)


@dataclass(frozen=True)
class Verdict:
    """A case judged: q, low, high (6,) and the worst image's NEES with its limit, NaN where no run
    was done.
    """

    case: Case
    runs: list[Run]
    q: np.ndarray
    low: np.ndarray
    high: np.ndarray
    worst: float
    limit: float
    word: str
    reason: str

    def row(self) -> str:
        """A line of the table."""
        done = [run for run in self.runs if run.exit == "done"]
        counts = (
            f"{len(done)} / {sum(run.exit == 'stopped' for run in self.runs)} /"
            f" {sum(run.exit == 'defect' for run in self.runs)}"
        )
        cells = ["-"] * 4
        if done:
            rms = np.sqrt(np.mean([run.rms**2 for run in done], axis=0))
            p, a = (
                int(np.argmax(self.q[:3] / self.high[:3])),
                3 + int(np.argmax(self.q[3:] / self.high[3:])),
            )
            cells = [
                " ".join(f"{1e3 * value:.1f}" for value in rms[:3]),
                " ".join(f"{np.degrees(value):.3f}" for value in rms[3:]),
                "; ".join(
                    f"{self.q[k]:.2f} {NAMES[k]} ({self.low[k]:.2f}-{self.high[k]:.2f})"
                    for k in (p, a)
                ),
                f"{self.worst:.0f} ({self.limit:.0f})",
            ]
        reason = textwrap.shorten(self.reason.replace("|", "/"), 240, placeholder=" ...")
        ending = f"; {'of the others: ' if done else ''}{reason}" if reason else ""
        return f"| {self.case.name} | {counts} | {' | '.join(cells)} | {self.word}{ending} |"


def conclude(case: Case, runs: list[Run], factor: np.ndarray) -> Verdict:
    """Hold the runs of a case against the bounds."""
    done = [run for run in runs if run.exit == "done"]
    reasons = [run.reason for run in runs if run.exit == "defect"] or [
        run.reason for run in runs if run.exit == "stopped"
    ]
    reason = reasons[0] if reasons else ""
    broken = any(run.exit == "defect" for run in runs)
    if not done:
        none = np.full(6, np.nan)
        return Verdict(
            case, runs, none, none, none, np.nan, np.nan, "FAILED" if broken else "stopped", reason
        )
    freedom = sum(np.maximum(run.n_eff * factor, 1.0) for run in done)
    q = sum(run.q * run.n_eff for run in done) / sum(run.n_eff for run in done)
    tail = 0.5 * ERROR_RATE / 6.0
    low, high = chi2.ppf(tail, freedom) / freedom, chi2.ppf(1.0 - tail, freedom) / freedom
    every = np.concatenate([run.nees for run in done])
    worst, limit = float(every.max()), float(chi2.ppf(1.0 - ERROR_RATE / every.size, 6))
    word = "covered"
    if broken or (q > high).any() or worst > limit:
        word = "FAILED" if broken or not case.beyond else f"not covered, {case.beyond}"
    elif (q < low).any():
        word = (
            "covered, wide in"
            f" {', '.join(name for name, wide in zip(NAMES, q < low, strict=True) if wide)}"
        )
    return Verdict(case, runs, q, low, high, worst, limit, word, reason)


def page(verdicts: list[Verdict], factor: np.ndarray, runs: int) -> str:
    """The page of the docs."""
    share = ", ".join(f"{name} {value:.2f}" for name, value in zip(NAMES, factor, strict=True))
    counts = [
        sum(verdict.word.startswith(word) for verdict in verdicts)
        for word in ("covered", "stopped", "not covered", "FAILED")
    ]
    head = f"""\
# Fault campaign

Written by `python scripts/fault_campaign.py --write`, which says how it is done. \
Simulated flights, {runs} seeds a case unless the count
says more; each is written as files with one fault and processed from them.

Cases: {len(verdicts)}. Covered: {counts[0]}; stopped with a reason: {counts[1]}; \
not covered, because the data cannot show it: {counts[2]};
failed: {counts[3]}.

- done / stopped / defect: runs that gave results, that ended with a reason, \
that ended in a traceback.
- rms: errors of projection centre (E N U, mm) and attitude (psi about E N U, deg) \
at the images, over all runs that are done.
- mean squared z: of the worst position and the worst attitude component, \
with its bounds at {100 * ERROR_RATE:g} %; 1 is honest, larger
  is too confident. Share of the effective samples by covariance that Monte Carlo confirms: {share}.
- worst image: normalised error squared of the six components together, \
and what the worst image exceeds in {100 * ERROR_RATE:g} % of cases.

| fault | done / stopped / defect | position rms | attitude rms | mean squared z \
| worst image | verdict |
|---|---|---|---|---|---|---|
"""
    return (
        head
        + "\n".join(verdict.row() for verdict in verdicts)
        + "\n\n![mean squared z of every case; grey, the widest bounds of its six"
        " components](fault_campaign.png)\n"
    )


def draw(verdicts: list[Verdict], path: Path) -> None:
    """Mean squared z of all components of every case against its bounds."""
    from matplotlib.figure import Figure

    shown = [verdict for verdict in verdicts if np.isfinite(verdict.q).all()]
    figure = Figure(figsize=(9.5, 1.5 + 0.24 * len(shown)), layout="constrained")
    axes = figure.subplots()
    for y, verdict in enumerate(shown):
        axes.plot(
            [verdict.low.min(), verdict.high.max()],
            [y, y],
            color="0.85",
            lw=7,
            solid_capstyle="butt",
            zorder=0,
        )
        for k in range(6):
            axes.plot(
                verdict.q[k],
                y,
                "os"[k > 2],
                color=f"C{k % 3}",
                ms=4,
                label=NAMES[k] if y == 0 else None,
            )
    axes.set(
        yticks=range(len(shown)),
        xscale="log",
        xlabel="mean of (error / standard deviation)^2 over images and runs",
    )
    axes.set_yticklabels([verdict.case.name for verdict in shown], fontsize=7)
    axes.axvline(1.0, color="0.4", lw=0.8)
    axes.invert_yaxis()
    axes.legend(ncols=6, fontsize=7, loc="lower center", bbox_to_anchor=(0.4, 1.0), frameon=False)
    figure.savefig(path, dpi=120)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=(
            "Process simulated flights with one fault each, and judge their standard deviations"
        )
    )
    parser.add_argument("--runs", type=int, default=6, help="seeds a case")
    parser.add_argument("--only", default="", help="cases whose name holds this")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument(
        "--write", action="store_true", help=f"write {PAGE.name} and its figure into benchmarks/"
    )
    options = parser.parse_args()
    cases = [case for case in CASES if options.only in case.name or case is CASES[0]]
    with ProcessPoolExecutor(options.jobs) as pool:
        waiting = [
            [pool.submit(fly, case.of(seed), seed) for seed in range(case.runs or options.runs)]
            for case in cases
        ]
        verdicts: list[Verdict] = []
        factor = np.ones(6)
        for case, futures in zip(cases, waiting, strict=True):
            runs = [future.result() for future in futures]
            if not verdicts:
                factor = confirmed_share([runs])
                print(
                    "share of the effective samples that is confirmed: ",
                    factor.round(2),
                    flush=True,
                )
            verdicts.append(conclude(case, runs, factor))
            print(verdicts[-1].row(), flush=True)
    if options.write:
        PAGE.write_text(page(verdicts, factor, options.runs), encoding="utf-8", newline="\n")
        draw(verdicts, PAGE.with_suffix(".png"))
        print(f"wrote {PAGE} and {PAGE.with_suffix('.png').name}")
    failed = [verdict.case.name for verdict in verdicts if verdict.word == "FAILED"]
    assert not failed, f"{len(failed)} of {len(verdicts)} cases failed: {'; '.join(failed)}"


if __name__ == "__main__":
    main()
