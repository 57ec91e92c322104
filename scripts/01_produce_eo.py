"""Story 1: from raw IMU, GNSS and camera events to EO_local-plane.txt, and how good it is.

    python scripts/01_produce_eo.py
        a simulated 15-minute block flight at 500 Hz, with its truth
    python scripts/01_produce_eo.py --quick
        the same in small: 6 minutes at 100 Hz, begun in the air
    python scripts/01_produce_eo.py --flight my/flight.toml
        your own flight

It ends in EO_local-plane.txt (and the other products), a figure, and an assertion. The assertion,
where there is a truth: each of E, N, U, omega, phi, kappa has a normalised error (error over the
standard deviation that stands in the file, root mean square over the images) between 0.5 and 2. The
mean over many flights is 1. One flight gives one draw of a few slow errors that most of its images
share (the attitude rests on biases that are constant for minutes), so a single value scatters by
tens of percent, and a factor of two is what a filter that lies about its accuracy, but hardly one
that does not, goes beyond.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import insgnss
from insgnss.io.formats.orientation.eo_local_plane import LocalPlaneEo, read_eo_local_plane

NAMES = ("E", "N", "U", "omega", "phi", "kappa")


def main() -> None:
    options = parse_options()
    options.out.mkdir(parents=True, exist_ok=True)

    # 1. A flight: raw data and the flight file that describes them.
    flight_file = options.flight or simulate(options.out, options.quick)

    # 2. The whole way from raw data to products.
    result = insgnss.process(flight_file, options.out, progress=print)
    print(result.summary())

    # 3. What a bundle adjustment reads, against the truth where there is one.
    eo = read_eo_local_plane(options.out / "EO_local-plane.txt")
    truth_file = flight_file.parent / "truth" / "EO_local-plane.txt"
    error = errors(eo, read_eo_local_plane(truth_file)) if truth_file.exists() else None

    # 4. A figure.
    figure = options.out / "produce_eo.png"
    draw(eo, error, figure)
    print(f"wrote {figure}")

    # 5. The assertion.
    assert eo.sigma_position_m is not None, "EO_local-plane.txt has no standard deviations"
    assert len(eo.images) == len(result.eo.images), "an image is missing in EO_local-plane.txt"
    if error is not None:
        normalised = np.sqrt(np.mean((error / sigmas(eo)) ** 2, axis=0))
        print(
            "normalised errors: "
            + ", ".join(
                f"{name} {value:.2f}" for name, value in zip(NAMES, normalised, strict=True)
            )
        )
        assert np.all((normalised > 0.5) & (normalised < 2.0)), (
            f"normalised errors {normalised.round(2)} outside 0.5 to 2"
        )


def parse_options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Produce EO_local-plane.txt from raw data.")
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("story_1"),
        help="directory of all results (default: story_1)",
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
        small = {"imu_rate_hz": 100.0, "start_in_air": True} if quick else {"imu_rate_hz": 500.0}
        insgnss.simulate("ign8", 6.0 if quick else 15.0, directory=directory, seed=1, **small)
    return directory / "flight.toml"


def sigmas(eo: LocalPlaneEo) -> np.ndarray:
    """(n, 6) standard deviations of E N U (m) and omega phi kappa (rad)."""
    return np.hstack([eo.sigma_position_m, eo.sigma_opk])


def errors(eo: LocalPlaneEo, truth: LocalPlaneEo) -> np.ndarray:
    """(n, 6) truth minus estimate of E N U (m) and omega phi kappa (rad), image by image."""
    row = {image: k for k, image in enumerate(truth.images)}
    at = [row[image] for image in eo.images]
    angle = truth.opk[at] - eo.opk
    return np.hstack([truth.position_m[at] - eo.position_m, (angle + np.pi) % (2 * np.pi) - np.pi])


def draw(eo: LocalPlaneEo, error: np.ndarray | None, path: Path) -> None:
    """Left the images on the map with their error vectors, right the errors of all six columns
    between their 3-sigma bounds.
    """
    figure = Figure(figsize=(13, 7.5), layout="constrained")
    left, right = figure.subfigures(1, 2, width_ratios=(1, 1.15))
    plan = left.subplots()
    east, north, _ = eo.position_m.T
    plan.plot(east, north, "o", color="0.75", ms=4)
    if error is not None:
        arrows = plan.quiver(
            east, north, *1e3 * error.T[:2], color="tab:red", width=0.003, angles="xy", scale=80
        )
        plan.margins(0.12)
        plan.quiverkey(arrows, 0.9, 0.04, 10, "10 mm", labelpos="N")
    for k in (0, -1):
        plan.annotate(
            eo.images[k], (east[k], north[k]), xytext=(6, 6), textcoords="offset points", fontsize=8
        )
    plan.set(
        aspect="equal",
        xlabel="E, m",
        ylabel="N, m",
        title=f"{len(eo.images)} projection centres"
        + (", truth minus estimate" * (error is not None)),
    )
    plan.ticklabel_format(useOffset=False)
    scale = np.array([1e3] * 3 + [np.degrees(1.0)] * 3)
    for k, axes in enumerate(right.subplots(6, 1, sharex=True)):
        bound = 3.0 * sigmas(eo)[:, k] * scale[k]
        axes.fill_between(
            np.arange(bound.size),
            -bound,
            bound,
            step="mid",
            color="tab:blue",
            alpha=0.2,
            lw=0,
            label="3 sigma",
        )
        if error is not None:
            axes.plot(
                error[:, k] * scale[k], ".", color="tab:red", ms=4, label="truth minus estimate"
            )
        axes.set_ylabel(f"{NAMES[k]}, {'mm' if k < 3 else 'deg'}")
        axes.margins(x=0.01)
        if k == 0:
            axes.legend(
                ncols=2, fontsize=8, loc="lower right", bbox_to_anchor=(1, 1), frameon=False
            )
    axes.set_xlabel("image, in the order of exposure")
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main()
