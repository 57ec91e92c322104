"""Story 2: from the master eo.json to metashape.csv, and a proof that Metashape will see the same
block.

    python scripts/02_export_metashape.py             a simulated 5-minute flight
    python scripts/02_export_metashape.py --quick     a smaller one
    python scripts/02_export_metashape.py --flight my/flight.toml --targets
    my/WGS84_tangentplane.txt

The two files say the same in different words: EO_local-plane.txt in one tangent plane with omega,
phi, kappa; metashape.csv in longitude, latitude, height with yaw, pitch, roll about east, north, up
*at each camera*. The proof projects ground targets into the images through both, with formulas that
share nothing with the writers, and asserts that the image points agree:

    EO_local-plane   R = Rx(omega) Ry(phi) Rz(kappa) of scipy, targets in the tangent plane as they
                     are
    metashape        R = Rz(-yaw) Rx(pitch) Ry(roll) (Metashape's ypr2mat), targets carried by PROJ
                     from the tangent plane over geocentric coordinates into the topocentric frame
                     of the camera

What may differ is what the digits leave out: 1e-4 m in E, N, U and height, 1e-10 deg (0.01 mm) in
longitude and latitude, 1e-6 deg in all angles. From 140 m above ground at 5469 px of focal length
half a digit of position is 0.002 px, of angle 0.00005 px; the two files together may make 0.005 px
of it. The bound is 0.02 px. Axes of the origin in place of the camera's would be 0.17 px at 200 m
from it, a wrong height, north or angle order far more.
"""

import argparse
import csv
import re
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from pyproj import Transformer
from scipy.spatial.transform import Rotation

import insgnss

FOCAL_PX, WIDTH_PX, HEIGHT_PX = (
    0.035 / 6.4e-6,
    5120,
    3840,
)  # the camera of paper 000, without distortion
PRINTED_PX, LIMIT_PX = 0.005, 0.02


def main() -> None:
    options = parse_options()
    options.out.mkdir(parents=True, exist_ok=True)

    # 1. A processed flight: its eo.json is the master from which every export derives.
    flight_file = options.flight or simulate(options.out, options.quick)
    insgnss.process(flight_file, options.out)
    master = insgnss.read_eo(options.out / "eo.json")

    # 2. The export.
    name = "metashape.csv"
    insgnss.export(master, "metashape", options.out / name)
    print(f"wrote {options.out / name}")

    # 3. Ground targets through both files.
    targets_file = (
        options.targets or flight_file.parent / "01_Observations/Camera/GCPs/WGS84_tangentplane.txt"
    )
    targets = np.loadtxt(targets_file, usecols=(1, 2, 3), ndmin=2)
    by_plane = through_local_plane(options.out / "EO_local-plane.txt", targets)
    by_metashape = through_metashape(
        options.out / name, targets, origin_of(options.out / "EO_local-plane.txt")
    )
    assert list(by_plane) == list(by_metashape), "the files do not hold the same images"
    first, second = np.array(list(by_plane.values())), np.array(list(by_metashape.values()))
    seen = (np.abs(first) < [0.5 * WIDTH_PX, 0.5 * HEIGHT_PX]).all(axis=-1)
    difference = (second - first)[seen]

    # 4. A figure.
    figure = options.out / "export_metashape.png"
    draw(first[seen], difference, figure)
    print(f"wrote {figure}")

    # 5. The assertion.
    assert seen.any(), "no image sees a target"
    greatest = np.hypot(*difference.T).max()
    print(
        f"{seen.sum()} image points of {len(targets)} targets agree to {1e3 * greatest:.2f}"
        " thousandths of a pixel"
    )
    assert greatest < LIMIT_PX, f"EO_local-plane.txt and {name} differ by {greatest:.3f} px"


def parse_options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description="Export to Metashape and prove it by re-projection."
    )
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("story_2"),
        help="directory of all results (default: story_2)",
    )
    parser.add_argument(
        "--flight", type=Path, help="a flight.toml; without it a flight is simulated"
    )
    parser.add_argument(
        "--targets", type=Path, help="id E N U of ground targets in the flight's tangent plane"
    )
    parser.add_argument("--quick", action="store_true", help="simulate a small flight")
    return parser.parse_args()


def simulate(out: Path, quick: bool) -> Path:
    """Flight file of a simulated data set, made anew unless it is there."""
    directory = out / ("flight_quick" if quick else "flight")
    if not directory.exists():
        rate, minutes = (100.0, 3.0) if quick else (500.0, 5.0)
        insgnss.simulate(
            "ign8", minutes, directory=directory, imu_rate_hz=rate, seed=2, start_in_air=True
        )
    return directory / "flight.toml"


def origin_of(path: Path) -> tuple[float, ...]:
    """Latitude, longitude (deg) and height (m) that the header of EO_local-plane.txt gives for the
    origin.
    """
    said = re.search(
        r"# origin: latitude (\S+) deg, longitude (\S+) deg, ellipsoidal height (\S+) m",
        path.read_text(encoding="utf-8"),
    )
    assert said is not None, f"{path}: the header names no origin"
    return tuple(float(number) for number in said.groups())


def through_local_plane(path: Path, targets: np.ndarray) -> dict[str, np.ndarray]:
    """Image points (t, 2), px, of targets (t, 3), E N U, in every image of EO_local-plane.txt."""
    points = {}
    for line in path.read_text(encoding="utf-8").splitlines():
        if not line.startswith("#"):
            image, *numbers = line.split()
            pose = np.array(numbers[:6], dtype=float)
            points[image] = image_points(
                Rotation.from_euler("XYZ", pose[3:], degrees=True).as_matrix(), targets - pose[:3]
            )
    return points


def through_metashape(
    path: Path, targets: np.ndarray, origin: tuple[float, ...]
) -> dict[str, np.ndarray]:
    """Image points (t, 2), px, of the targets (t, 3), in the tangent plane of `origin`, in every
    image of metashape.csv.
    """
    geocentric = topocentric(*origin).transform(*targets.T, direction="INVERSE")
    points = {}
    with path.open(encoding="utf-8", newline="") as stream:
        for label, *numbers in list(csv.reader(stream))[1:]:
            lon, lat, height, *ypr = np.array(numbers[:6], dtype=float)
            yaw, pitch, roll = np.radians(ypr)
            about = np.column_stack(topocentric(lat, lon, height).transform(*geocentric))
            points[label] = image_points(rz(-yaw) @ rx(pitch) @ ry(roll), about)
    return points


def topocentric(lat: float, lon: float, height: float) -> Transformer:
    """PROJ's operation from geocentric coordinates to east, north, up at a point (deg, m)."""
    return Transformer.from_pipeline(
        f"+proj=topocentric +ellps=WGS84 +lat_0={lat:.12f} +lon_0={lon:.12f} +h_0={height:.6f}"
    )


def rx(a: float) -> np.ndarray:
    return np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])


def ry(a: float) -> np.ndarray:
    return np.array([[np.cos(a), 0, np.sin(a)], [0, 1, 0], [-np.sin(a), 0, np.cos(a)]])


def rz(a: float) -> np.ndarray:
    return np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])


def image_points(R: np.ndarray, ray: np.ndarray) -> np.ndarray:
    """Pixels right and down of the image centre (t, 2) of rays (t, 3) from the camera; R takes
    right, up, back to their axes.
    """
    right, up, back = R.T @ ray.T
    with np.errstate(divide="ignore"):
        pixels = FOCAL_PX * np.column_stack([right / -back, up / back])
    return np.where(back[:, None] < 0, pixels, np.inf)  # behind the camera: not seen


def draw(points: np.ndarray, difference: np.ndarray, path: Path) -> None:
    """Left where the targets lie in the images, right how far the two files differ there."""
    figure = Figure(figsize=(12, 5.4), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.45, 1))
    left.plot(*points.T, ".", color="tab:blue", ms=5, alpha=0.6)
    left.set(
        xlim=(-WIDTH_PX / 2, WIDTH_PX / 2), ylim=(HEIGHT_PX / 2, -HEIGHT_PX / 2), aspect="equal"
    )
    left.set(
        xlabel="x from the centre, px",
        ylabel="y from the centre, px",
        title=f"{len(points)} image points of ground targets, all images",
    )
    right.plot(*1e3 * difference.T, ".", color="tab:red", ms=5, alpha=0.6)
    circle = np.linspace(0, 2 * np.pi, 200)
    for radius, style, what in ((PRINTED_PX, "--", "printed digits"), (LIMIT_PX, "-", "limit")):
        right.plot(
            1e3 * radius * np.cos(circle),
            1e3 * radius * np.sin(circle),
            style,
            color="0.4",
            lw=1,
            label=f"{what}, {radius} px",
        )
    right.axhline(0, color="0.8", lw=0.8, zorder=0)
    right.axvline(0, color="0.8", lw=0.8, zorder=0)
    right.set(
        aspect="equal",
        xlabel="x, px / 1000",
        ylabel="y, px / 1000",
        title="metashape.csv minus EO_local-plane.txt",
    )
    right.set_ylim(-23, 28)
    right.legend(loc="upper center", ncols=2, fontsize=9, frameon=False)
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main()
