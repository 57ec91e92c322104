"""Draw the pictures of the documentation that no tutorial makes, from runs of the program.

    python scripts/draw_gallery.py --runs DIR [--only NAME ...]

Runs that are missing in DIR are made: the demo, a simulated recording that nobody describes, an
image block, a season. Pictures of pages are taken by Playwright with the Chromium of the system
(`pip install '.[oracles]'`). All go into docs/images, reduced by `run_page.reduce_picture`.
"""

import argparse
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from run_page import reduce_picture

import insgnss

BROKEN = 3  # exit code of a season with flights of bad input
IMAGES = Path(__file__).resolve().parents[1] / "docs" / "images"


def insgnss_command(directory: Path, *words: str) -> None:
    """Run a verb in a directory."""
    subprocess.run([sys.executable, "-m", "insgnss", *words, "-q"], cwd=directory, check=True)


def screenshot(page: Path, picture: Path, scheme: str = "light", height: int = 1000) -> None:
    """Take a picture of the top of a page in a light or dark browser."""
    from playwright.sync_api import sync_playwright

    browser_path = next(
        path
        for name in ("chromium", "chromium-browser", "google-chrome")
        if (path := shutil.which(name))
    )
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=browser_path, args=["--no-sandbox"])
        context = browser.new_context(
            viewport={"width": 1100, "height": height}, color_scheme=scheme
        )
        tab = context.new_page()
        tab.goto(page.resolve().as_uri())
        tab.wait_for_timeout(1500)
        tab.screenshot(path=picture)
        browser.close()


def report(runs: Path) -> None:
    """The report of the demo, as it opens."""
    screenshot(demo(runs) / "report.html", runs / "report.png", height=1230)


def report_dark(runs: Path) -> None:
    """The same at night."""
    screenshot(demo(runs) / "report.html", runs / "report_dark.png", "dark", 800)


def demo(runs: Path) -> Path:
    """Products of the demo."""
    if not (runs / "insgnss_demo").exists():
        insgnss_command(runs, "demo")
    return runs / "insgnss_demo" / "02_Processed" / "GPS-INS"


def recognition(runs: Path) -> None:
    """What `insgnss inspect --write` draws of a recording with other units and axes."""
    directory = runs / "undescribed"
    if not directory.exists():
        sim = insgnss.simulate("ign8", 6.0, imu_rate_hz=100.0, seed=3, imu_axes="right forward up")
        directory.mkdir()
        gyro, accel = np.degrees(sim.imu.gyro), sim.imu.accel / 9.80665
        imu = np.column_stack([sim.imu.time, gyro, accel])
        np.savetxt(
            directory / "imu.csv", imu, "%.9g", ",", header="tow,gx,gy,gz,ax,ay,az", comments=""
        )
        fixes = [sim.gnss.time, np.degrees(sim.gnss.lat), np.degrees(sim.gnss.lon)]
        gnss = np.column_stack([*fixes, sim.gnss.height])
        np.savetxt(directory / "gps.csv", gnss, "%.11g", ",", header="tow,lat,lon,h", comments="")
        insgnss_command(directory, "inspect", "imu.csv", "gps.csv", "--write")
    shutil.copy(directory / "recognition.png", runs / "recognition.png")


def block(runs: Path) -> Path:
    """Products of an adjusted image block."""
    if not (runs / "images").exists():
        insgnss_command(
            runs, "simulate", "images", "--block", "--minutes", "8", "--imu-rate", "200"
        )
        insgnss_command(runs, "process", "images")
        insgnss_command(runs, "adjust", "images")
    return runs / "images" / "02_Processed" / "Adjustment"


def adjustment(runs: Path) -> None:
    """The page of `insgnss adjust`."""
    screenshot(block(runs) / "adjust.html", runs / "adjustment.png", height=1100)


def comparison(runs: Path) -> None:
    """The page of `insgnss compare`: the demo against its truth."""
    page = runs / "differences.html"
    if not page.exists():
        truth = demo(runs).parents[1] / "truth" / "EO_local-plane.txt"
        insgnss_command(
            runs, "compare", str(demo(runs) / "eo.json"), str(truth), "--page", page.name
        )
    screenshot(page, runs / "comparison.png", height=1000)


def season(runs: Path) -> None:
    """The page of `insgnss batch`: twelve flights of one wing, one of them broken."""
    directory = runs / "season"
    for k in range(1, 13):
        flight = directory / f"f{k:02d}"
        if not flight.exists():
            options = ("--minutes", "3", "--imu-rate", "50", "--seed", str(k))
            insgnss_command(runs, "simulate", str(flight), *options)
            file = flight / "flight.toml"
            text = file.read_text().replace("gps_week = 2008", f"gps_week = {2400 + k}")
            if k == 7:
                text = text.replace('"forward right down"', '"right forward up"')
            file.write_text(text)
    if not (directory / "index.html").exists():
        command = [sys.executable, "-m", "insgnss", "batch", directory.name, "--again", "-q"]
        if subprocess.run(command, cwd=runs, check=False).returncode != BROKEN:
            raise SystemExit("batch: the broken flight was not refused")
    screenshot(directory / "index.html", runs / "season.png", height=1100)


def heading(runs: Path) -> None:
    """Heading and tilt along a corridor with three kinds of IMU, and what shows the heading."""
    figure = Figure(figsize=(9.5, 6.5), layout="constrained")
    top, below = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    for colour, noise in zip(
        ("tab:red", "tab:blue", "tab:green"), ("consumer", "navchip", "tactical"), strict=True
    ):
        sim = insgnss.simulate("ign6x1", 8.0, imu_rate_hz=100.0, noise=noise, seed=0)
        done = insgnss.estimate(sim.imu, sim.gnss, noise=noise, mounting=sim.mounting)
        flown = done.trajectory
        minutes = (flown.time - flown.time[0]) / 60.0
        sigma = np.degrees(np.sqrt(np.diagonal(flown.cov, axis1=1, axis2=2)[:, 6:9]))
        top.plot(minutes, sigma[:, 2], color=colour, label=f"heading, {noise}")
        top.plot(minutes, sigma[:, 0], "--", color=colour, lw=1, label=f"tilt, {noise}")
        if noise == "navchip":
            speed = np.gradient(flown.velocity_ned[:, :2], flown.time, axis=0)
            below.plot(minutes, np.hypot(*speed.T), color="0.3", lw=0.8)
    top.set(yscale="log", ylabel="standard deviation, deg")
    top.legend(ncols=3, fontsize=9)
    top.grid(alpha=0.3)
    below.set(xlabel="minutes", ylabel="horizontal acceleration,\nm/s$^2$")
    below.grid(alpha=0.3)
    figure.savefig(runs / "heading.png", dpi=120)


PICTURES: dict[str, Callable[[Path], None]] = {
    drawn.__name__: drawn
    for drawn in (report, report_dark, recognition, adjustment, comparison, season, heading)
}


def main() -> None:
    """Draw them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=Path, required=True, help="where runs are, or are made")
    parser.add_argument("--only", nargs="+", choices=PICTURES, default=list(PICTURES))
    options = parser.parse_args()
    options.runs.mkdir(parents=True, exist_ok=True)
    for name in options.only:
        PICTURES[name](options.runs.resolve())
        reduce_picture(options.runs / f"{name}.png", IMAGES / f"{name}.png")
        print(f"wrote {IMAGES / name}.png")


if __name__ == "__main__":
    main()
