"""Monte Carlo of relative control: which weighting of neighbouring images is as large as their
errors?

Every flight is simulated with its own gusts, IMU errors (Table 5 of paper 000 with turn-on biases)
and fixes, aligned, filtered and smoothed from the data alone. On the straight line nearest to its
middle seven images are exposed, 0.5, 1, 2, 4, 7 and 10 s apart, and the relative poses of
neighbours are compared with the truth, in the mapping and in the camera form. The error squared
over its covariance (NEES) is chi-square of six degrees of freedom, its sum over N flights of 6 N.
With the smoothed cross-covariance it must lie within the two-sided 99 % bounds for all six gaps and
both forms together; by how much the weightings of paper 003 (equations 5 and 6) fail is what the
figure shows. Equation 6 gets the gyroscopes' figures from the noise model that the flights were
simulated with: white noise, and as "uncalibrated drift" those of its processes that live shorter
than the flight.

    python scripts/monte_carlo_relative.py --flights 300 --seed 0

prints a table, writes a figure, and ends with an error where a bound is broken.
"""

import argparse
import os
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # matrices of 30 x 30

import numpy as np
from matplotlib.figure import Figure
from scipy.stats import chi2

from insgnss.geodesy.rotation import vector_from_rotation
from insgnss.navigation.align.initial import initial_state
from insgnss.navigation.filter.epochs import make_epochs
from insgnss.navigation.filter.filter import gate_from_sigma
from insgnss.navigation.filter.layout import state_layout
from insgnss.navigation.filter.problem import EstimationProblem
from insgnss.navigation.filter.solution import solve
from insgnss.navigation.filter.trajectory import trajectory
from insgnss.navigation.noise_model.model import load_noise_model
from insgnss.navigation.orient.exterior import exterior_orientation
from insgnss.navigation.orient.frame import in_frame
from insgnss.navigation.orient.relative import GyroFigures, gyro_figures, relative_control
from insgnss.navigation.prepare.clock import cut_fixes
from insgnss.navigation.prepare.increments import body_increments, merge_marks
from insgnss.records import CameraEvents, ExteriorOrientation
from insgnss.records.cameras.mounting import Mounting
from insgnss.simulation.scenario import ImuOptions, SimulatedFlight, simulate_flight, true_eo

NOISE = "navchip"
GAPS_S = (0.5, 1.0, 2.0, 4.0, 7.0, 10.0)
FORMS = ("mapping", "camera")
WEIGHTINGS = ("independent", "gyro", "smoothed")
LABELS = {
    "independent": "equation 5: independent",
    "gyro": "equation 6: gyroscopes",
    "smoothed": "smoothed cross-covariance",
}
COLOURS = {"independent": "#0072B2", "gyro": "#D55E00", "smoothed": "#009E73"}
COMPONENTS = ("horizontal position", "height", "tilt", "heading")


def figures_of_the_model(minutes: float) -> GyroFigures:
    """White noise of the gyroscopes, and the part of their bias that changes within the flight; the
    filter estimates the rest.
    """
    axes = load_noise_model(NOISE).gyro
    wandering = np.array(
        [
            [p.sigma for p in axis.gauss_markov if p.correlation_time_s < 60.0 * minutes]
            for axis in axes
        ]
    )
    return gyro_figures(np.array([axis.white_noise for axis in axes]), wandering)


def exposures(sim: SimulatedFlight) -> np.ndarray:
    """Seven instants on the straight line whose middle is nearest to that of the flight."""
    time = sim.truth.eo.time
    breaks = np.flatnonzero(np.diff(time) > 4.0) + 1
    lines = [part for part in np.split(time, breaks) if part[-1] - part[0] > sum(GAPS_S)]
    middle = 0.5 * (sim.flight.motion.start + sim.flight.motion.end)
    line = min(lines, key=lambda part: abs(0.5 * (part[0] + part[-1]) - middle))
    return line[0] + np.concatenate([[0.0], np.cumsum(GAPS_S)])


def orientations(seed: int, minutes: float) -> tuple[ExteriorOrientation, ExteriorOrientation]:
    """Exterior orientation of the seven images as estimated, and the truth."""
    imu = ImuOptions(rate_hz=100.0, noise=NOISE)
    sim = simulate_flight(
        "ign8", minutes, seed=seed, imu=imu, start_in_air=True, line_length_m=600.0
    )
    at = exposures(sim)
    images = tuple(f"{k}.tif" for k in range(at.size))
    fixes = cut_fixes(sim.gnss, sim.imu.time[0], sim.imu.time[-1])
    marks, (at_fix, at_event) = merge_marks(fixes.time, at)
    inc = body_increments(sim.imu, np.eye(3), marks)
    frame = sim.flight.motion.frame
    epochs = make_epochs(inc, at_fix, fixes, at_event, frame)
    problem = EstimationProblem(
        inc,
        epochs,
        frame,
        state_layout(load_noise_model(NOISE)),
        sim.rig.antenna_lever_b,
        gate_from_sigma(5.0),
        0.1,
    )
    solution = solve(problem, initial_state(problem).start, separations=0)
    path = trajectory(solution, solution.event_epochs, sim.flight.gps_week, events=True)
    rig = sim.rig
    mounting = Mounting(rig.antenna_m, rig.imu_m, rig.camera_from_body, rig.boresight)
    eo = exterior_orientation(path, CameraEvents(images, path.time), mounting, sim.tangent_plane)
    return eo, true_eo(
        replace(sim.flight, images=images, time=path.time), sim.rig, sim.tangent_plane
    )


def judge_flight(
    seed: int, minutes: float, gyro: GyroFigures
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """NEES (forms, weightings, gaps), errors (gaps, 6) and variances (weightings, gaps, 6) of the
    mapping form.
    """
    eo, truth = (in_frame(x, "tangent plane") for x in orientations(seed, minutes))
    nees = np.zeros((len(FORMS), len(WEIGHTINGS), len(GAPS_S)))
    for f, form in enumerate(FORMS):
        found, true = relative_control(eo, gyro, form), relative_control(truth, gyro, form)
        assert found.i.size == len(GAPS_S), (
            f"seed {seed}: {found.i.size} of {len(GAPS_S)} pairs lie in one line"
        )
        psi = vector_from_rotation(true.rotation @ np.swapaxes(found.rotation, 1, 2))
        error = np.hstack([true.offset - found.offset, psi])
        for w, name in enumerate(WEIGHTINGS):
            nees[f, w] = np.einsum(
                "ki,ki->k", error, np.linalg.solve(getattr(found, name), error[:, :, None])[:, :, 0]
            )
        if form == "mapping":
            of_mapping = (
                error,
                np.stack(
                    [np.diagonal(getattr(found, name), axis1=1, axis2=2) for name in WEIGHTINGS]
                ),
            )
    return nees, *of_mapping


def of_components(squares: np.ndarray) -> np.ndarray:
    """Mean squares (..., 6) of E N U and psi as (..., 4) of `COMPONENTS`."""
    return np.stack(
        [squares[..., :2].mean(-1), squares[..., 2], squares[..., 3:5].mean(-1), squares[..., 5]],
        axis=-1,
    )


def draw(nees: np.ndarray, error: np.ndarray, variance: np.ndarray, path: Path) -> None:
    """Top the NEES over the gap, in both forms; below what each weighting promises of the
    components, and what the errors are.
    """
    flights = len(nees)
    low, high = chi2.ppf([0.005, 0.995], 6 * flights) / (6 * flights)
    figure = Figure(figsize=(11.5, 8.2), layout="constrained")
    top, bottom = figure.subfigures(2, 1, height_ratios=(1, 1.05))
    for f, axis in enumerate(top.subplots(1, 2, sharey=True)):
        axis.axhspan(low, high, color="0.85", label="99 % bounds")
        axis.axhline(1.0, color="0.5", lw=0.8)
        for w, name in enumerate(WEIGHTINGS):
            axis.plot(
                GAPS_S,
                nees[:, f, w].mean(axis=0) / 6.0,
                "o-",
                color=COLOURS[name],
                label=LABELS[name],
            )
        axis.set(
            xscale="log",
            yscale="log",
            title=f"{FORMS[f]} form",
            xlabel="time between the exposures, s",
        )
        plain(axis)
        axis.grid(alpha=0.3)
    axis.legend(fontsize=8)
    top.axes[0].set_ylabel("NEES over 6 degrees of freedom")
    top.suptitle(
        f"Relative pose of neighbouring images: error squared over its covariance, {flights}"
        " simulated flights",
        size=11,
    )
    actual, promised = (
        np.sqrt(of_components((error**2).mean(axis=0))),
        np.sqrt(of_components(variance.mean(axis=0))),
    )
    for c, axis in enumerate(bottom.subplots(1, 4)):
        scale, unit = (1e3, "mm") if c < 2 else (np.degrees(1.0), "deg")
        for w, name in enumerate(WEIGHTINGS):
            shift = {"lw": 1.4} if name != "gyro" or c > 1 else {"lw": 1.4, "ls": (0, (4, 4))}
            axis.plot(GAPS_S, scale * promised[w, :, c], color=COLOURS[name], **shift)
        axis.plot(GAPS_S, scale * actual[:, c], "ko", ms=4.5, label="rms of the errors")
        axis.set(xscale="log", title=COMPONENTS[c], xlabel="s", ylabel=unit)
        axis.set_ylim(bottom=0.0)
        plain(axis, vertical=False)
        axis.grid(alpha=0.3)
    bottom.axes[2].legend(fontsize=8, loc="upper left")
    bottom.suptitle(
        "What the weightings promise (lines, colours as above) and what the errors are (dots),"
        " mapping form",
        size=11,
    )
    figure.savefig(path, dpi=110)


def plain(axis: object, vertical: bool = True) -> None:
    """Plain numbers on logarithmic axes, a tick at each gap."""
    axis.set_xticks(GAPS_S, [f"{gap:g}" for gap in GAPS_S])
    axis.minorticks_off()
    if vertical:
        marks = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
        axis.set_yticks(marks, [f"{mark:g}" for mark in marks])


def report(nees: np.ndarray, error: np.ndarray, variance: np.ndarray, gyro: GyroFigures) -> None:
    """The table on standard output."""
    n = len(nees)
    low, high = chi2.ppf([0.005, 0.995], 6 * n) / (6 * n)
    print(
        f"{n} flights; gyroscopes {np.degrees(gyro.noise) * 60:.4f} deg/sqrt(h), drift"
        f" {np.degrees(gyro.drift) * 3600:.1f} deg/h"
    )
    print(f"NEES over 6 degrees of freedom, 99 % bounds {low:.3f} to {high:.3f}; columns: gap, s")
    print(" " * 22 + "".join(f"{gap:9g}" for gap in GAPS_S))
    for f, form in enumerate(FORMS):
        for w, name in enumerate(WEIGHTINGS):
            print(
                f"  {form:<8}{name:<12}"
                + "".join(f"{x:9.3f}" for x in nees[:, f, w].mean(axis=0) / 6.0)
            )
    actual, promised = (
        np.sqrt(of_components((error**2).mean(axis=0))),
        np.sqrt(of_components(variance.mean(axis=0))),
    )
    print("promised standard deviation over the rms of the errors, mapping form")
    for c, component in enumerate(COMPONENTS):
        for w, name in enumerate(WEIGHTINGS):
            print(
                f"  {component:<20}{name:<12}"
                + "".join(f"{x:9.2f}" for x in promised[w, :, c] / actual[:, c])
            )


def main() -> None:
    """Fly, judge, print, draw, and hold the third weighting against its bounds."""
    parser = argparse.ArgumentParser(
        description="Consistency of the weightings of relative control over many simulated flights"
    )
    parser.add_argument("--flights", type=int, default=300)
    parser.add_argument("--minutes", type=float, default=4.0, help="of each flight")
    parser.add_argument(
        "--seed", type=int, default=0, help="of the first flight; the others count up"
    )
    parser.add_argument("--figure", type=Path, default=Path("relative_control.png"))
    options = parser.parse_args()
    gyro = figures_of_the_model(options.minutes)
    flown = [judge_flight(options.seed + k, options.minutes, gyro) for k in range(options.flights)]
    nees, error, variance = (np.array(column) for column in zip(*flown, strict=True))
    report(nees, error, variance, gyro)
    draw(nees, error, variance, options.figure)
    print(f"figure: {options.figure}")
    tests = len(FORMS) * len(GAPS_S)
    low, high = chi2.ppf([0.005 / tests, 1.0 - 0.005 / tests], 6 * options.flights)
    of_smoothed = nees[:, :, WEIGHTINGS.index("smoothed")].sum(axis=0)
    assert (of_smoothed > low).all(), "the smoothed covariance of a relative pose is too large"
    assert (of_smoothed < high).all(), "the smoothed covariance of a relative pose is too small"


if __name__ == "__main__":
    main()
