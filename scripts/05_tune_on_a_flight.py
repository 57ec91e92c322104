"""Story 5: the noise of an IMU in flight, from the innovations of the filter, and what it does to
the covariances.

    python scripts/05_tune_on_a_flight.py
        a simulated block flight of 40 minutes whose airframe vibrates
    python scripts/05_tune_on_a_flight.py --quick
        12 minutes, begun in the air, with fixes of half a centimetre
    python scripts/05_tune_on_a_flight.py --flight my/flight.toml
        your own flight

In flight the simulated NavChip has three times the white noise that its model, measured at rest,
knows, and a line of the propeller at 83 Hz. `insgnss tune --flight` finds the factor of each triad.
It ends in a noise model, two figures, and assertions: the static model gives way, both factors lie
within 10 % of the truth (25 % after the small flight), and the errors of the images fit their
covariances again. Errors squared over their covariances (NEES), of images a minute apart, must lie
within the two-sided 99 % bounds of chi-square with the model found, where with the static model
they did not.
"""

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from scipy.stats import chi2

import insgnss
from insgnss.geodesy.rotation import vector_from_rotation
from insgnss.simulation.faults import ImuFaults, Vibration

TRIPLED = 3.0
APART_S = 60.0


def main() -> None:
    options = parse_options()
    options.out.mkdir(parents=True, exist_ok=True)

    # 1. A flight: raw data and the flight file that describes them, the IMU by its static model.
    flight = insgnss.load_flight(options.flight or simulate(options.out, options.quick))

    # 2. Tuning on its innovations.
    tuning = insgnss.tune(
        flight, out=options.out / "in_flight_noise.toml", force=True, progress=print
    )
    print(tuning.summary())

    # 3. The flight processed with the static model and with the one found; errors against the truth
    # where there is one.
    eo_file = flight.path.parent / "truth" / "eo.npz"
    nees = None
    if eo_file.exists():
        models = [flight.imu.noise, *([str(tuning.file)] if tuning.file else [])]
        runs = [
            insgnss.process(
                flight.with_(imu__noise=m, filter__adaptive_noise="off"), options.out / f"run{k}"
            )
            for k, m in enumerate(models)
        ]
        nees = [errors_squared(run.eo, eo_file) for run in runs]

    # 4. A figure, beside the spectrum that the tuning has drawn.
    draw(tuning, nees, options.out / "tune_on_a_flight.png")
    print(f"wrote {options.out / 'tune_on_a_flight.png'}")

    # 5. The assertions.
    if nees is not None:
        check(tuning, flight, nees, 0.25 if options.quick else 0.1)


def parse_options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Tune the noise of an IMU on a flight.")
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("story_5"),
        help="directory of all results (default: story_5)",
    )
    parser.add_argument(
        "--flight", type=Path, help="a flight.toml; without it a flight is simulated"
    )
    parser.add_argument("--quick", action="store_true", help="simulate a small flight")
    return parser.parse_args()


def simulate(out: Path, quick: bool) -> Path:
    """Flight file of a simulated data set, made anew unless it is there."""
    directory = out / ("flight_quick" if quick else "flight")
    if not directory.exists():
        propeller = ImuFaults(
            vibration=Vibration(accel_ms2=1.0, gyro_rad_s=0.01, frequency_hz=83.0, start_s=60.0)
        )
        small = (
            {"minutes": 12.0, "start_in_air": True, "gnss_sigma_m": (0.005, 0.005, 0.008)}
            if quick
            else {}
        )
        shaken = {"vibration": TRIPLED, "imu_faults": propeller}
        insgnss.simulate("ign8", directory=directory, imu_rate_hz=250.0, seed=1, **shaken, **small)
    return directory / "flight.toml"


def errors_squared(
    eo: insgnss.ExteriorOrientation, truth_file: Path
) -> tuple[np.ndarray, np.ndarray]:
    """Time and NEES, of six degrees of freedom, of images `APART_S` apart."""
    truth = np.load(truth_file)
    row = {image: k for k, image in enumerate(truth["images"].tolist())}
    at = np.array([row[image] for image in eo.images])
    turn = vector_from_rotation(truth["C_mc"][at] @ np.swapaxes(eo.C_mc, -1, -2))
    error = np.hstack([truth["position_enu"][at] - eo.position_m, turn])
    picked = [0]
    for k, time in enumerate(eo.time):
        if time - eo.time[picked[-1]] >= APART_S:
            picked.append(k)
    chosen = np.array(picked)
    return eo.time[chosen], np.einsum(
        "ni,nij,nj->n", error[chosen], np.linalg.inv(eo.cov[chosen]), error[chosen]
    )


def check(
    tuning: Any, flight: insgnss.Flight, nees: list[tuple[np.ndarray, np.ndarray]], within: float
) -> None:
    """Hold the result against the simulation."""
    assert tuning.accepted, tuning.verdict
    for name, factor in tuning.noise.imu_factors().items():
        assert abs(factor / TRIPLED - 1.0) < within, f"{name}: {factor:.3f} against {TRIPLED:g}"
    count = 6 * nees[0][1].size
    low, high = chi2.ppf([0.005, 0.995], count) / count
    before, after = (squares.sum() / count for _, squares in nees)
    print(
        f"NEES of {nees[0][1].size} images, 99 % bounds {low:.2f} to {high:.2f}: {before:.2f} with"
        f" {flight.imu.noise}, {after:.2f} after"
    )
    assert before > high, "the static model was good enough"
    assert low < after < high, "the covariances do not fit the errors"


def draw(tuning: Any, nees: list[tuple[np.ndarray, np.ndarray]] | None, path: Path) -> None:
    """Left the factors with two standard errors, right the errors of the images over what their
    covariances say.
    """
    figure = Figure(figsize=(11.0, 4.4), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.4))
    n = tuning.noise
    place = np.arange(len(n.names))
    left.errorbar(
        n.factor,
        place,
        xerr=2.0 * n.factor * n.log_sigma,
        fmt="o",
        color="tab:blue",
        capsize=3,
        label="2 standard errors",
    )
    left.axvline(1.0, color="0.5", lw=0.8)
    left.set_yticks(place, n.names)
    left.set(
        xlabel="times the static model and the claims of the fixes",
        title=tuning.headline,
        ylim=(n.factor.size - 0.5, -0.5),
    )
    left.legend(frameon=False, fontsize=8)
    if nees is None:
        figure.delaxes(right)
    else:
        for (time, squares), label, colour in zip(
            nees, ("static model", "model found in flight"), ("tab:red", "tab:blue"), strict=False
        ):
            right.plot(
                (time - time[0]) / 60.0,
                squares / 6.0,
                "o-",
                lw=0.8,
                ms=4,
                color=colour,
                label=f"{label}: mean {squares.mean() / 6.0:.2f}",
            )
        low, high = chi2.ppf([0.005, 0.995], 6) / 6.0
        right.axhspan(low, high, color="0.9", zorder=0, label="99 % of honest ones")
        right.set(
            xlabel="minutes",
            ylabel="NEES a degree of freedom",
            title="images a minute apart",
            yscale="log",
        )
        right.legend(fontsize=8, loc="lower left")
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main()
