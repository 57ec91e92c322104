"""Story 9: a corridor with two ground points at each end, and a vehicle that the drone follows.

    python scripts/09_two_ground_points_and_a_vehicle.py
        the corridor of paper 004 (Molina et al. 2017), half a minute of work
    python scripts/09_two_ground_points_and_a_vehicle.py --quick
        without the configuration that serves as reference

A drone follows a vehicle along 2.3 km of road in one strip of 149 images. The vehicle has a target
on its roof, which 136 images see, and its trajectory says where that was at each exposure: a ground
control point an image, which nobody had to survey. The corridor is simulated with the standard
deviations of the paper's Table 2 (75 % of the variances of antenna and vehicle last for 300 s) and
adjusted as the paper does, with antenna positions alone and a camera that is estimated:

    CC          19 ground control points, no vehicle     insgnss adjust DIR/block_cc.toml
    MC          2 + 2 ground points and the vehicle      insgnss adjust DIR/block_mc.toml
    FC          all 37 ground points and the vehicle     insgnss adjust DIR/block_fc.toml
    4 points    2 + 2 ground points alone

and then MC once more with a vehicle whose clock is 0.2 s late, which is refused with the clock
named. It ends in a table beside the paper's Tables 3 and 4, a picture, and an assertion: the
vehicle makes the check points better than the four ground points alone by 1.5 at least in their
predicted standard deviations east and north, and the errors are as large as the predictions.
"""

import argparse
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from matplotlib.figure import Figure

import insgnss
from insgnss.flight.config.block_file import BlockFile, VehicleTable

PUBLISHED = {  # rms of check points, mm (Table 3); sigmas of f, x0, y0, px (Table 4)
    "CC": ("49 / 50 / 92", "0.69 / 0.61 / 0.66"),
    "MC": ("32 / 36 / 87", "1.04 / 0.66 / 0.68"),
    "FC": ("", "0.51 / 0.56 / 0.64"),
}
COLOURS = {"CC": "#8A8F98", "4 points": "#D55E00", "MC": "#0072B2"}
LATE_S = 0.2
GAIN = 1.5


def main() -> None:
    options = parse_options()
    options.out.mkdir(parents=True, exist_ok=True)

    # 1. The corridor, as `insgnss simulate DIR --flight mapkite` writes it.
    directory = options.out / f"corridor_{options.seed}"
    if not directory.exists():
        simulate(directory, options.seed)

    # 2. Its configurations.
    results = {way: adjusted(file, way) for way, file in configurations(directory, options.quick)}
    for way, result in results.items():
        assert result.refusal is None, f"{way}: {result.refusal}"
    table = report(results)
    (options.out / "corridor.txt").write_text(table, encoding="utf-8")

    # 3. A clock that is late.
    late = insgnss.load_block(directory / "block_mc.toml")
    late = replace(late, vehicle=replace(late.vehicle, time_offset_s=LATE_S))
    wrong = adjusted(late, "MC, clock 0.2 s late")
    print(f"a clock {LATE_S:g} s late: {wrong.refusal}")

    # 4. A picture.
    draw(results, options.out / "corridor.png")
    print(f"wrote {options.out / 'corridor.png'}")

    # 5. The assertion.
    gain = promised(results["4 points"]) / promised(results["MC"])
    print(f"four ground points alone over MC: {gain[0]:.2f} / {gain[1]:.2f} / {gain[2]:.2f}")
    assert (gain[:2] > GAIN).all(), "the vehicle does not make the corridor better by 1.5"
    for way in ("CC", "MC", "4 points"):
        together = results[way].figures["check_points_together"]
        mean = together["normalised_square"] / together["degrees_of_freedom"]
        assert 0.45 < mean < 1.85, f"{way}: errors are not as large as predicted ({mean:.2f})"
    assert wrong.refusal is not None, "a clock that is 0.2 s late went through"
    assert "vehicle's clock" in str(wrong.refusal), "the clock is not what is named"


def parse_options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Two ground points and a vehicle.")
    parser.add_argument(
        "--out", type=Path, default=Path("story_9"), help="directory of all results"
    )
    parser.add_argument("--quick", action="store_true", help="without the full configuration")
    parser.add_argument("--seed", type=int, default=0, help="of the simulation")
    return parser.parse_args()


def simulate(directory: Path, seed: int) -> None:
    """Write the corridor."""
    command = [sys.executable, "-m", "insgnss", "simulate", str(directory), "--flight", "mapkite"]
    subprocess.run([*command, "--seed", str(seed), "--quiet"], check=True)


def configurations(directory: Path, quick: bool) -> list[tuple[str, BlockFile]]:
    """Block files by name."""
    files = {way: insgnss.load_block(directory / f"block_{way}.toml") for way in ("cc", "mc", "fc")}
    ways = [("CC", files["cc"]), ("4 points", replace(files["mc"], vehicle=VehicleTable()))]
    ways.append(("MC", files["mc"]))
    return ways if quick else [*ways, ("FC", files["fc"])]


def adjusted(file: BlockFile, way: str) -> Any:
    """One configuration; nothing is written."""
    result = insgnss.adjust_block(file, write=False)
    print(f"{way}: {result.judgement.headline}")
    return result


def differences(result: Any) -> np.ndarray:
    """Check points, surveyed less adjusted (n, 3), m."""
    points = result.figures["check_points"]
    return np.array([c["difference_m"] for c in points if "difference_m" in c]).reshape(-1, 3)


def promised(result: Any, key: str = "sigma_adjusted_m") -> np.ndarray:
    """Predicted standard deviations of the check points, rms east, north, up, m."""
    points = result.figures["check_points"]
    sigma = np.array([c[key] for c in points if "difference_m" in c])
    return np.sqrt((sigma**2).mean(axis=0))


def report(results: dict[str, Any]) -> str:
    """The table beside those of the paper."""
    lines = [
        f"{'':10}{'rms E N U, mm':>20}{'predicted, mm':>20}{'paper, mm':>16}"
        f"{'sigma f x0 y0, px':>22}{'paper, px':>22}"
    ]
    for way, result in results.items():
        camera = result.figures["cameras"][0]["parameters"]
        sigma = " / ".join(f"{camera[name]['sigma']:.2f}" for name in ("f", "cx", "cy"))
        own = ["", ""]
        if len(d := differences(result)):
            values = (np.sqrt((d**2).mean(axis=0)), promised(result, "sigma_m"))
            own = [" / ".join(f"{1e3 * x:.0f}" for x in v) for v in values]
        paper = PUBLISHED.get(way, ("", ""))
        lines.append(f"{way:10}{own[0]:>20}{own[1]:>20}{paper[0]:>16}{sigma:>22}{paper[1]:>22}")
    text = "\n".join(lines) + "\n"
    print(text)
    return text


def draw(results: dict[str, Any], path: Path) -> None:
    """The corridor with its control, and the errors of its check points along the road."""
    figure = Figure(figsize=(11.5, 6.6), layout="constrained")
    left, right = figure.subfigures(1, 2, width_ratios=(1.0, 1.35))
    mc = results["MC"]
    axis = left.subplots()
    images = np.array([i["position_m"] for i in mc.figures["images"]])
    axis.plot(images[:, 0], images[:, 1], ".", color="0.7", ms=3, label="images")
    values, block = mc.solved.result.values, mc.solved.result.problem.block
    row = {name: k for k, name in enumerate(block.points)}
    kinematic = np.array([values.point[row[p["point"]]] for p in mc.figures["vehicle"]["points"]])
    axis.plot(kinematic[:, 0], kinematic[:, 1], "-", color=COLOURS["MC"], lw=2, label="vehicle")
    control = np.array([c["position_m"] for c in mc.figures["ground_control"]])
    axis.plot(control[:, 0], control[:, 1], "^", color="k", ms=8, label="ground control of MC")
    checks = np.array([c["position_m"] for c in mc.figures["check_points"]])
    axis.plot(checks[:, 0], checks[:, 1], "o", mfc="none", color="#009E73", label="check points")
    axis.set(aspect="equal", xlabel="east, m", ylabel="north, m", title="The corridor")
    axis.legend(fontsize=8)
    axis.grid(alpha=0.3)
    length = np.linalg.norm(checks[:, :2] - control[0, :2], axis=1)
    order = np.argsort(length)
    for k, axis in enumerate(right.subplots(3, 1, sharex=True)):
        for way, colour in COLOURS.items():
            error = 1e3 * differences(results[way])[order, k]
            points = results[way].figures["check_points"]
            sigma = 1e3 * np.array([c["sigma_m"] for c in points])[order, k]
            axis.fill_between(length[order], -2 * sigma, 2 * sigma, color=colour, alpha=0.13, lw=0)
            axis.plot(length[order], error, "o-", color=colour, ms=4, lw=1, label=way)
        axis.axhline(0.0, color="0.4", lw=0.7)
        axis.set_ylabel(("east", "north", "up")[k] + ", mm")
        axis.grid(alpha=0.3)
        if k == 0:
            axis.set_title("Check points: surveyed less adjusted; bands: 2 sigma")
            axis.legend(fontsize=8, ncols=3)
    axis.set_xlabel("from the first ground control point, m")
    figure.savefig(path, dpi=120)


if __name__ == "__main__":
    main()
