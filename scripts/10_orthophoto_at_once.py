"""Story 10: orthophoto at once: Fast AT (paper 003, Rehak and Skaloud 2016).

    python scripts/10_orthophoto_at_once.py
        block 2015 of the paper, simulated, half a minute of work
    python scripts/10_orthophoto_at_once.py --quick
        its corridor 2014

An orthophoto is wanted the evening after the flight. Tie points would have to be matched, and crops
match badly; direct orientation needs none, and every image is off by its own error of attitude, so
that roads break where images meet. Fast AT takes the few image measurements of the surveyed points
and the aerial control with its covariance, and nothing else. The story orients the block by direct
orientation, by Fast AT with absolute and with relative attitudes, and by an integrated adjustment
with thousands of tie points; each with the camera of an earlier calibration but the last.

An orthophoto shows at a place on the ground what the nearest image has there by its estimated pose
and camera. What it shows lies elsewhere: by the true pose and camera, on the true ground. The story
computes this displacement, and its step where the image changes.

It ends in a table beside the paper's, a picture (the steps, and a road across the worst of them),
and an assertion: Fast AT promises two pixels at the check points, errors are as promised, and the
orthophoto is better than that of direct orientation, sooner than with the integrated adjustment.
"""

import argparse
import csv
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import aerial_control_cases as cases
import numpy as np
from matplotlib.figure import Figure
from scipy.stats import chi2

from insgnss.records.cameras.camera import pixels_of, undistort
from insgnss.simulation.plug import import_plugged

simulate_survey = import_plugged("published_blocks.survey").simulate_survey

WAYS = ("DiSO", "F. AT Ap Aa", "F. AT Ap Ra", "ISO Ap Aa")
FAST = "F. AT Ap Ra"
CELL_M = 4.0
PIXEL_M = {"block2015": 0.045, "corridor2014": 0.038}  # Table 2
ROAD_M, STRIPE_M, PATCH_M = 3.0, 0.15, 6.0


@dataclass(frozen=True)
class Shown:
    """An orthophoto's places (n, 2) with the image each shows, its displacement (n, 2), m, and
    steps from place to place: rows (k, 2) of neighbours in other images.
    """

    position: np.ndarray
    image: np.ndarray
    displacement: np.ndarray
    steps: np.ndarray

    @property
    def step_m(self) -> np.ndarray:
        """How far apart what neighbours show is (k,)."""
        d = self.displacement
        return np.linalg.norm(d[self.steps[:, 1]] - d[self.steps[:, 0]], axis=1)


def main() -> None:
    options = parse_options()
    options.out.mkdir(parents=True, exist_ok=True)
    name = "corridor2014" if options.quick else "block2015"
    made = simulate_survey(name, options.seed)
    found, shown, seconds = {}, {}, {}
    with tempfile.TemporaryDirectory() as directory:
        file = cases.written(Path(directory) / name, made)
        cases.solution(cases.in_mode(file, FAST))  # kernels are compiled, or come from the cache
        for way in WAYS:
            # 1. The block oriented, and how long it took.
            block = cases.in_mode(file, way)
            start = time.process_time()
            done = cases.solution(block)
            seconds[way] = time.process_time() - start
            found[way] = cases.compared(done, made, poses=False)
            # 2. The orthophoto from these poses.
            shown[way] = orthophoto(done, made)

    # 3. The table, the picture.
    report(found, shown, seconds, name, options.out / "orthophoto.csv")
    draw(shown, options.out / "orthophoto.png")
    print(f"wrote {options.out / 'orthophoto.png'}")

    # 4. The assertion.
    points = 3 * len(found[FAST].difference_m)
    low, high = chi2.ppf((0.0005, 0.9995), points) / points
    across = np.sqrt((found[FAST].sigma_m[:, :2] ** 2).sum(axis=1).mean())
    assert across < 2.0 * PIXEL_M[name], f"Fast AT promises {1e3 * across:.0f} mm"
    assert low < found[FAST].normalised < high, "Fast AT: errors are not as promised"
    gain = typical(shown["DiSO"].step_m) / typical(shown[FAST].step_m)
    print(f"steps of Fast AT are {gain:.1f} times smaller than those of direct orientation")
    assert gain > 1.0, "Fast AT breaks roads as direct orientation does"
    faster = seconds["ISO Ap Aa"] / seconds[FAST]
    print(f"{faster:.0f} times faster than the integrated adjustment")
    assert faster > 1.0


def parse_options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="An orthophoto from Fast AT.")
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("story_10"),
        help="directory of all results (default: story_10)",
    )
    parser.add_argument("--quick", action="store_true", help="the corridor")
    parser.add_argument("--seed", type=int, default=1)
    return parser.parse_args()


def orthophoto(done: object, made: cases.SimulatedSurvey) -> Shown:
    """Displacements of what the nearest image shows, by adjusted against true poses and camera."""
    values, problem = done.result.values, done.result.problem
    row = {name: k for k, name in enumerate(made.truth.images)}
    rows = [row[name] for name in problem.block.images]
    position, attitude = values.position, values.C_mc
    if done.direct:  # of all images, those without surveyed points too
        rows, position, attitude = list(row.values()), made.eo.position_m, made.eo.C_mc
    X, C = made.truth.position_m[rows], made.truth.C_mc[rows]
    (camera,) = values.cameras(problem.block.cameras)
    true = made.survey.camera
    plan = made.truth.position_m[:, :2]
    low, high = plan.min(axis=0), plan.max(axis=0)
    axes = [np.arange(a, b, CELL_M) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    P = made.terrain.points(grid.reshape(-1, 2))
    away = np.linalg.norm(P[:, None, :2] - position[None, :, :2], axis=2)
    image = away.argmin(axis=1)
    q = np.einsum("nji,nj->ni", attitude[image], P - position[image])
    uv = pixels_of(camera, q[:, :2] / q[:, 2:])
    ideal = (uv - [true.of("cx"), true.of("cy")]) / true.of("f")
    ray = np.column_stack([undistort(ideal, true.interior), np.ones(len(P))])
    ray = np.einsum("nij,nj->ni", C[image], ray)
    reach = (P[:, 2] - X[image, 2]) / ray[:, 2]
    displacement = X[image, :2] + reach[:, None] * ray[:, :2] - P[:, :2]
    half = 0.5 * np.array([true.width, true.height])
    inside = (np.abs(uv - half) < half).all(axis=1)
    number = np.where(inside, image, -1).reshape(grid.shape[:2])
    rows_of = np.arange(len(P)).reshape(grid.shape[:2])
    steps = []
    for a, b, i, j in (
        (number[:-1], number[1:], rows_of[:-1], rows_of[1:]),
        (number[:, :-1], number[:, 1:], rows_of[:, :-1], rows_of[:, 1:]),
    ):
        seam = (a != b) & (a >= 0) & (b >= 0)
        steps.append(np.column_stack([i[seam], j[seam]]))
    displacement[~inside] = np.nan
    return Shown(P[:, :2], np.where(inside, image, -1), displacement, np.vstack(steps))


def typical(values: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean(np.square(values))))


def report(found: dict, shown: dict, seconds: dict, name: str, path: Path) -> None:
    """Print the table beside the paper's and write it."""
    print(f"{name}: check points E N U, and the orthophoto, mm, root mean square")
    print(
        f"{'':12} {'simulated':>18} {'promised':>18} {'paper 003':>18} {'orthophoto':>11}"
        f" {'steps':>6} {'largest':>8} {'CPU s':>6}"
    )
    rows = []
    for way in WAYS:
        own = 1e3 * np.sqrt((found[way].difference_m ** 2).mean(axis=0))
        promised = 1e3 * np.sqrt((found[way].sigma_m ** 2).mean(axis=0))
        paper = np.array(cases.PUBLISHED[name][way][3:], dtype=float)
        d, steps = shown[way].displacement, shown[way].step_m
        all_over = 1e3 * typical(d) * np.sqrt(2.0)
        largest = 1e3 * float(np.nanmax(steps))
        rows.append(
            [way, *own.round(1), *promised.round(1), *paper]
            + [round(x, 2) for x in (all_over, 1e3 * typical(steps), largest, seconds[way])]
        )
        texts = "".join(f" {a:6.0f}{b:6.0f}{c:6.0f}" for a, b, c in (own, promised, paper))
        print(
            f"{way:12}{texts} {all_over:11.0f} {1e3 * typical(steps):6.0f} {largest:8.0f}"
            f" {seconds[way]:6.2f}"
        )
    head = [f"{kind}_{axis}_mm" for kind in ("rms", "promised", "paper") for axis in "enu"]
    head += ["orthophoto_mm", "steps_mm", "largest_step_mm", "cpu_s"]
    with path.open("w", newline="", encoding="utf-8") as stream:
        csv.writer(stream).writerows([["mode", *head], *rows])


def draw(shown: dict, path: Path) -> None:
    """Steps on the ground, and a road with markings across the worst step of direct orientation."""
    ways = ("DiSO", FAST, "ISO Ap Aa")
    figure = Figure(figsize=(12.0, 8.0), layout="constrained")
    axes = figure.subplots(2, len(ways))
    worst = shown[ways[0]].steps[np.nanargmax(shown[ways[0]].step_m)]
    for k, way in enumerate(ways):
        own = shown[way]
        where = own.position[own.steps].mean(axis=1)
        dots = axes[0, k].scatter(
            *where.T, c=1e3 * own.step_m, s=3, cmap="inferno_r", vmin=0.0, vmax=250.0
        )
        axes[0, k].set_aspect("equal")
        axes[0, k].set_xlabel("east, m")
        axes[0, k].set_title(
            f"{way}: steps {1e3 * typical(own.step_m):.0f} mm", loc="left", fontsize=10
        )
        axes[1, k].imshow(
            road(own, worst), cmap="gray", extent=(0.0, PATCH_M, 0.0, PATCH_M), vmin=0.0, vmax=1.0
        )
        axes[1, k].set_title("a road across the worst of DiSO", loc="left", fontsize=10)
    axes[0, 0].set_ylabel("north, m")
    axes[1, 1].set_xlabel("along the road, m")
    figure.colorbar(dots, ax=axes[0], label="step between images, mm", shrink=0.8)
    figure.savefig(path, dpi=120)


def road(own: Shown, seam: np.ndarray) -> np.ndarray:
    """A road with markings that crosses a seam, as the orthophoto shows it."""
    first, second = own.displacement[seam]
    if np.isnan([first, second]).any():
        first = second = np.zeros(2)
    way = own.position[seam[1]] - own.position[seam[0]]
    way = way / np.linalg.norm(way)
    right = np.array([way[1], -way[0]])
    grid = np.linspace(-0.5, 0.5, 300) * PATCH_M
    along, across = np.meshgrid(grid, grid[::-1])
    d = np.where((along < 0.0)[..., None], first, second)
    along, across = along + d @ way, across - d @ right
    noise = 0.08 * np.sin(37.0 * along + 11.0 * np.sin(3.0 * across)) * np.sin(29.0 * across)
    ground = 0.55 + noise
    paved = np.abs(across) < 0.5 * ROAD_M
    ground[paved] = 0.3 + 0.3 * noise[paved]
    edge = np.abs(np.abs(across) - 0.45 * ROAD_M) < 0.5 * STRIPE_M
    dashes = (np.abs(across) < 0.5 * STRIPE_M) & (np.mod(along, 2.0) < 1.2)
    ground[edge | dashes] = 0.95
    return ground


if __name__ == "__main__":
    main()
