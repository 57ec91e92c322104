"""Blocks without an IMU: what does `insgnss adjust` say of right positions, and of wrong ones?

Copters, fixed wings and oblique images are flown over rolling ground, with positions of 1 to 3 cm
(RTK, independent or correlated over 300 s) in a .MRK, ground points in UTM, first attitudes that
are off by a third of a degree, and a camera that is a few pixels off. Good blocks: normalised
squares of poses, camera and points against the truth. Mistakes of users of sizes from harmless to
gross are planted alone in copies of the files. A run is

    culprit          refused, or told, and the message names what was planted, or a pair with it
    covered          calm, and every pose is within 4 of its sigmas or within 2 cm
    told             refused, or told, in general words or with another cause
    blamed           the same, and a lever arm or a datum is blamed that was not planted
    disclosed        as silent, but a remark (right blocks have it, too) gives the size that would
                     go unnoticed
    silent           calm, and a pose is off by more than both
    wrongly          harmless, and told
    traceback        ended by what is no error of the package

    python scripts/wrong_positions.py --good 30
    python scripts/wrong_positions.py --seeds 3 --only ambiguity
"""

import argparse
import contextlib
import io
import json
import os
import re
import sys
import tempfile
import textwrap
import time
import traceback
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # on a shared machine more threads only spin

import numpy as np
from scipy.stats import chi2

from insgnss import read_eo
from insgnss.cli.main import main as insgnss
from insgnss.flight.config.block_file import load_block
from insgnss.geodesy.frames import TangentPlane
from insgnss.geodesy.projection import MapProjection
from insgnss.geodesy.rotation import (
    CV_RUB,
    opk_from_rotation,
    rotation_from_rpy,
    rotation_from_vector,
    vector_from_rotation,
)
from insgnss.io.formats.blocks.camera_toml import write_camera_toml
from insgnss.io.formats.blocks.image_points import ImagePoints, write_image_points
from insgnss.photogrammetry.block_adjustment.run import adjust
from insgnss.records.block import INTERIOR, BrownCamera, ImageObservations
from insgnss.simulation.image_block import (
    BlockOptions,
    Visible,
    seen_points,
    tie_points,
    under_images,
)
from insgnss.simulation.image_block import _draw_terrain as rolling
from insgnss.simulation.plug import import_plugged

Array = np.ndarray
gauss_markov = import_plugged("published_blocks.pose_errors").gauss_markov

ORIGIN = (np.radians(46.57), np.radians(6.54), 450.0)
WEEK, FIRST_TOW, CRS, GEOID_M = 2300, 200000.0, "EPSG:32632", 48.3
VERDICTS = ("culprit", "covered", "told", "disclosed", "blamed", "silent", "wrongly", "traceback")
BAD = VERDICTS[4:]
NEED_M, WORST_Z = 0.02, 4.0
CORRELATION_S = 300.0
CAMERA = BrownCamera(
    "copter",
    5472,
    3648,
    np.array(
        [
            {"f": 3666.0, "cx": 2741.0, "cy": 1829.0, "k1": -0.012, "k2": 0.015, "p1": 4e-4}.get(
                name, 0.0
            )
            for name in INTERIOR
        ]
    ),
    free=("f", "cx", "cy", "k1", "k2", "p1", "p2"),
)


@dataclass(frozen=True)
class Plan:
    """A flight: lines and images of each, base, spacing, height (m), speed (m/s), what it does."""

    lines: int
    images: int
    base_m: float
    spacing_m: float
    height_m: float
    speed_mps: float
    tilt_deg: tuple[float, float, float]  # scatter of roll, pitch, yaw
    crab_deg: float
    oblique_deg: float = 0.0
    turns: bool = True  # the camera turns with the course of the line
    crossed: bool = False  # half of the lines lie across the others


PLANS = {
    "copter": Plan(5, 12, 16.0, 32.0, 80.0, 8.0, (1.0, 1.0, 2.0), 0.0),
    "wing": Plan(5, 12, 28.0, 55.0, 140.0, 16.0, (3.0, 2.0, 2.0), 8.0),
    "oblique": Plan(6, 9, 18.0, 32.0, 70.0, 6.0, (1.0, 1.0, 2.0), 0.0, 25.0, True, True),
}


@dataclass
class Block:
    """Content of the files of a block, and its truth; a plant changes the content."""

    plan: Plan
    time: Array
    line: Array
    true_X: Array
    true_C: Array
    true_point: dict[str, Array]
    measured: ImagePoints
    position: Array  # as the receiver has it, before it is written
    sigma_m: Array
    C: Array  # first attitudes
    camera: BrownCamera
    ground: dict[str, Array]
    ground_sigma: Array
    check: dict[str, bool]
    number: Array
    options: list[str] = field(default_factory=list)
    names: list[str] = field(default_factory=list)
    written_sigma: Callable[[Array], Array] = lambda s: s
    written_ground: Callable[[Array], Array] = lambda x: x
    columns: bool = True  # whether first attitudes are given

    @property
    def velocity(self) -> Array:
        """Velocities of the images, m/s."""
        out = np.zeros_like(self.true_X)
        for k in np.unique(self.line):
            rows = np.flatnonzero(self.line == k)
            way = self.true_X[rows[-1]] - self.true_X[rows[0]]
            out[rows] = self.plan.speed_mps * way / np.linalg.norm(way)
        return out


def flown(plan: Plan, draw: np.random.Generator) -> tuple[Array, Array, Array, Array]:
    """Return times, lines, positions and attitudes of the images."""
    clock, times, lines, places, attitudes = FIRST_TOW, [], [], [], []
    for k in range(plan.lines):
        across = plan.crossed and k >= plan.lines // 2
        n_side = plan.lines // 2 if plan.crossed else plan.lines
        side = ((k % n_side) - 0.5 * (n_side - 1)) * plan.spacing_m * (1.5 if plan.crossed else 1)
        along = (np.arange(plan.images) - 0.5 * (plan.images - 1)) * plan.base_m * (-1.0) ** k
        course = 0.35 + (np.pi / 2 if across else 0.0) + (np.pi if k % 2 else 0.0)
        e = np.array([np.sin(course - np.pi * (k % 2)), np.cos(course - np.pi * (k % 2))])
        right = np.array([e[1], -e[0]])
        XY = along[:, None] * e + side * right
        up = plan.height_m + 0.5 * draw.standard_normal(plan.images)
        places.append(np.column_stack([XY + 0.5 * draw.standard_normal(XY.shape), up]))
        times.append(clock + np.arange(plan.images) * plan.base_m / plan.speed_mps)
        clock = times[-1][-1] + 15.0
        lines.append(np.full(plan.images, k))
        rpy = np.radians(draw.standard_normal((plan.images, 3)) * plan.tilt_deg)
        rpy[:, 1] += np.radians(plan.oblique_deg)
        rpy[:, 2] += (course if plan.turns else 0.35) + np.radians(plan.crab_deg)
        enu_ned = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
        # image right is the drone's right, image down its back
        attitudes.append(
            enu_ned @ rotation_from_rpy(rpy) @ np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])
        )
    return (
        np.concatenate(times),
        np.concatenate(lines),
        np.vstack(places),
        np.concatenate(attitudes),
    )


def block_of(kind: str, seed: int, correlated: float = 0.0, control: int = 5) -> Block:
    """Simulate a block; `correlated`: share of the variance of fixes that errs for minutes."""
    plan, draw = PLANS[kind], np.random.default_rng([seed, sorted(PLANS).index(kind)])
    time_of, line, X, C = flown(plan, draw)
    n = len(X)
    terrain = rolling(0.0, 0.12 * plan.height_m, draw)
    names = tuple(f"DJI_{k + 1:04d}.JPG" for k in range(n))

    class Truth:
        images, position_m, C_mc = names, X, C

    options = BlockOptions(tie_points=40.0, matched=0.7, true_camera=CAMERA)
    ties = tie_points(Truth, terrain, options, draw)
    spread = under_images(Truth, terrain, 400, draw)
    seen = seen_points(Truth, spread, CAMERA)
    targets = seen.chosen(_far_apart(spread, np.flatnonzero(seen.rays() >= 4), control + 5))
    visible = Visible(
        np.vstack([ties.position, targets.position]),
        np.r_[ties.image, targets.image],
        np.r_[ties.point, targets.point + len(ties.position)],
        np.vstack([ties.uv, targets.uv]),
    )
    m = len(ties.position)
    order = np.lexsort((visible.point, visible.image))
    sigma = np.where(visible.point < m, 0.5, 0.3)[order, None] * np.ones(2)
    uv = visible.uv[order] + sigma * draw.standard_normal((order.size, 2))
    point_names = (
        *(f"T{k:05d}" for k in range(m)),
        *(f"G{k + 1:02d}" for k in range(len(targets.position))),
    )
    measured = ImagePoints(
        names,
        point_names,
        ImageObservations(visible.image[order], visible.point[order], uv, sigma),
    )
    horizontal = draw.uniform(0.01, 0.02)
    s = np.array([horizontal, horizontal, 1.5 * horizontal])
    slow = gauss_markov(time_of, CORRELATION_S, 3, draw)
    white = draw.standard_normal((n, 3))
    error = s * (np.sqrt(correlated) * slow + np.sqrt(1.0 - correlated) * white)
    interior = np.array(CAMERA.interior)
    interior[:3] += draw.normal(0.0, [6.0, 4.0, 4.0])
    ground_sigma = np.array([0.01, 0.01, 0.015])
    surveyed = targets.position + ground_sigma * draw.standard_normal(targets.position.shape)
    at = np.array(point_names[m:])
    stated = s * np.sqrt(1.0 - correlated) if correlated else s
    block = Block(
        plan,
        time_of,
        line,
        X,
        C,
        dict(zip(point_names, visible.position, strict=True)),
        measured,
        X + error,
        np.tile(stated, (n, 1)),
        rotation_from_vector(np.radians(0.33) * draw.standard_normal((n, 3))) @ C,
        replace(CAMERA, interior=interior),
        dict(zip(at, surveyed, strict=True)),
        ground_sigma,
        {name: k >= control for k, name in enumerate(at)},
        np.arange(1, n + 1),
        names=list(names),
    )
    if correlated:
        block.options = ["--shift-sigma", *(f"{x:.4f}" for x in s * np.sqrt(correlated))]
        block.options += ["--shift-correlation", f"{CORRELATION_S:g}"]
    return block


def _far_apart(position: Array, rows: Array, count: int) -> list[int]:
    """Return points that are far from each other."""
    chosen = [int(rows[0])]
    while len(chosen) < min(count, rows.size):
        gap = np.linalg.norm(position[rows, None, :2] - position[chosen][None, :, :2], axis=2)
        chosen.append(int(rows[np.argmax(gap.min(axis=1))]))
    return chosen


def written(block: Block, directory: Path) -> list[str]:
    """Write the files, and return the command."""
    plane = TangentPlane(*ORIGIN)
    lat, lon, h = plane.geodetic_from_position(block.position)
    sigma = block.written_sigma(block.sigma_m)
    (directory / "Timestamp.MRK").write_text(
        "".join(
            f"{k}\t{t:.6f}\t[{WEEK}]\t0,N\t0,E\t0,V\t{np.degrees(a):.10f},Lat"
            f"\t{np.degrees(b):.10f},Lon\t{c:.4f},Ellh\t{s[0]:.6f}, {s[1]:.6f}, {s[2]:.6f}\t50,Q\n"
            for k, t, a, b, c, s in zip(block.number, block.time, lat, lon, h, sigma, strict=True)
        )
    )
    table = replace(block.measured, images=tuple(block.names))
    write_image_points(table, directory / "image_points.csv")
    write_camera_toml(block.camera, directory / "camera.toml")
    X = np.array(list(block.ground.values()))
    grid = np.array(MapProjection(CRS).forward(*plane.geodetic_from_position(X)))
    grid = block.written_ground(grid)
    rows = [
        f"{name},{x:.4f},{y:.4f},{z:.4f},{','.join(f'{s:.4f}' for s in block.ground_sigma)},"
        f"{'check' if block.check[name] else 'control'}\n"
        for name, (x, y, z) in zip(block.ground, grid, strict=True)
    ]
    head = "point,x,y,z,sigma_x,sigma_y,sigma_z,role\n"
    (directory / "ground.csv").write_text("".join([head, *rows]))
    write_first(block, plane, directory / "EO.txt")
    command = ["adjust", str(directory / "Timestamp.MRK"), "-q"]
    for option, name in (
        ("--images", "image_points.csv"),
        ("--camera", "camera.toml"),
        ("--initial", "EO.txt"),
        ("--out", "out"),
        ("--ground", "ground.csv"),
    ):
        command += [option, str(directory / name)]
    return [*command, "--crs", CRS, *block.options]


def write_first(block: Block, plane: TangentPlane, path: Path) -> None:
    """Write first attitudes, with places good to some metres."""
    opk = np.degrees(opk_from_rotation(block.C @ CV_RUB))
    origin = f"{np.degrees(plane.lat):.10f} {np.degrees(plane.lon):.10f} deg {plane.height:.3f} m"
    rows = [f"# tangent plane, origin {origin}", "# image E N U omega phi kappa"]
    for name, x, a in zip(block.names, block.true_X, opk, strict=True):
        rows.append(" ".join([name, *(f"{v:.3f}" for v in x), *(f"{v:.5f}" for v in a)]))
    path.write_text("\n".join(rows) + "\n")


Plant = Callable[[Block, float, np.random.Generator], None]


@dataclass(frozen=True)
class Case:
    """A mistake: `plant` changes the content of the files, `culprit` is the pattern that names it.

    `sizes` : of the mistake, in `unit`. `harmless` : the sizes of which nothing may be said.
    `blames` : the lever arm or a datum is what was planted, or looks alike.
    """

    name: str
    plant: Plant
    culprit: str
    sizes: tuple[float, ...] = (1.0,)
    unit: str = ""
    harmless: tuple[float, ...] = ()
    blames: bool = False
    kinds: tuple[str, ...] = tuple(PLANS)


def lever_up(block: Block, size: float, draw: np.random.Generator) -> None:
    """The antenna is above the camera, and nobody said so."""
    block.position = block.position + [0.0, 0.0, size]


def line_rows(block: Block, k: int = 2) -> Array:
    """Return the images of one line."""
    return np.flatnonzero(block.line == k)


def lever_up_camera_held(block: Block, size: float, draw: np.random.Generator) -> None:
    """The antenna is above the camera, which is held at its right constants."""
    lever_up(block, size, draw)
    block.camera = replace(CAMERA, free=())


def missed_in_line(block: Block, size: float, draw: np.random.Generator) -> None:
    """One photograph of a line is missing: from there the images have the positions of others."""
    rows = line_rows(block)
    rows = rows[int(draw.integers(0, 4)) :]
    n = int(size)
    block.position[rows[:-n]] = block.position[rows[n:]]
    block.position[rows[-n:]] += (
        n * block.plan.base_m / block.plan.speed_mps * block.velocity[rows[-n:]]
    )


def missed_from(block: Block, size: float, draw: np.random.Generator) -> None:
    """One photograph is missing: from there to the end images have the position of the next."""
    begin = int(draw.integers(10, len(block.time) - 20))
    n = int(size)
    block.position[begin:-n] = block.position[begin + n :].copy()
    block.time[begin:-n] = block.time[begin + n :].copy()
    block.position[-n:] += block.velocity[-n:] * 2.0
    block.time[-n:] += 2.0


def turned_line(block: Block, size: float, draw: np.random.Generator) -> None:
    """First attitudes of a line are turned about the vertical."""
    rows = line_rows(block)
    block.C[rows] = rotation_from_vector(np.radians([0.0, 0.0, size])) @ block.C[rows]


def reversed_line(block: Block, size: float, draw: np.random.Generator) -> None:
    """The images of a line are numbered from its end."""
    rows = line_rows(block)
    block.position[rows] = block.position[rows[::-1]]


def half_geoid(block: Block, size: float, draw: np.random.Generator) -> None:
    """Half of the ground control has heights above the geoid."""
    control = [name for name in block.ground if not block.check[name]]
    for name in control[::2] if size > 0 else control[:2]:
        block.ground[name] = block.ground[name] - [0.0, 0.0, abs(size)]


def all_geoid(block: Block, size: float, draw: np.random.Generator) -> None:
    """All ground points have heights above the geoid."""
    for name in block.ground:
        block.ground[name] = block.ground[name] - [0.0, 0.0, size]


def camera_off(hold: bool) -> Plant:
    """The camera constant is wrong, and held or estimated."""

    def plant(block: Block, size: float, draw: np.random.Generator) -> None:
        interior = np.array(CAMERA.interior)
        interior[0] *= 1.0 + 0.01 * size
        free = () if hold else CAMERA.free
        block.camera = replace(CAMERA, interior=interior, free=free)

    return plant


def renamed(block: Block, size: float, draw: np.random.Generator) -> None:
    """Images have other names in the image observations; the first values as well."""
    block.names = [f"IMG_{int(name[4:8]) + int(size):04d}.JPG" for name in block.names]


def number_off(block: Block, size: float, draw: np.random.Generator) -> None:
    """Positions count from another number than the images."""
    block.number = block.number + int(size)


def shuffled(block: Block, size: float, draw: np.random.Generator) -> None:
    """Rows of the positions lost their order: sorted by latitude, and numbered anew."""
    order = np.argsort(block.position[:, 1])
    block.position, block.time = block.position[order], block.time
    block.sigma_m = block.sigma_m[order]


def ground_as(change: Callable[[Array], Array]) -> Plant:
    """Coordinates of ground points as they are written."""

    def plant(block: Block, size: float, draw: np.random.Generator) -> None:
        block.written_ground = change

    return plant


def late(block: Block, size: float, draw: np.random.Generator) -> None:
    """Events are stamped late: positions are those of a later time."""
    block.position = block.position + size * block.velocity
    block.time = block.time + size


def sigmas_as(block: Block, size: float, draw: np.random.Generator) -> None:
    """Standard deviations in another unit."""
    block.written_sigma = lambda s: np.maximum(s * size, 1e-6)


def ambiguity(block: Block, size: float, draw: np.random.Generator) -> None:
    """A wrong ambiguity shifts one line."""
    way = draw.standard_normal(3) * [1.0, 1.0, 0.5]
    block.position[line_rows(block)] += size * way / np.linalg.norm(way)


def two_exchanged(block: Block, size: float, draw: np.random.Generator) -> None:
    """Two control points have each other's names."""
    control = [name for name in block.ground if not block.check[name]]
    a, b = control[1], control[3]
    block.ground[a], block.ground[b] = block.ground[b], block.ground[a]


CASES = (
    Case("nothing", lambda b, s, d: None, "(?!)", harmless=(1.0,)),
    Case(
        "lever arm upwards",
        lever_up,
        r"lever arm|antenna",
        (0.01, 0.05, 0.15, 0.5),
        "m",
        (0.01,),
        True,
    ),
    Case(
        "lever arm upwards, camera held",
        lever_up_camera_held,
        r"lever arm|antenna",
        (0.05, 0.15),
        "m",
        (),
        True,
    ),
    Case(
        "one missed photograph in a line",
        missed_in_line,
        r"had the position of the image",
        (1.0, 2.0),
    ),
    Case(
        "one missed photograph, to the end",
        missed_from,
        r"had the position of the image",
        (1.0, 2.0),
    ),
    Case(
        "first attitudes of a line turned",
        turned_line,
        r"turned by",
        (20.0, 90.0, 180.0),
        "deg",
    ),
    Case("a line numbered from its end", reversed_line, r"reverse order"),
    Case(
        "half of control without geoid",
        half_geoid,
        r"stand beside|control point G0[135]|left out: G0",
        (0.3, 5.0, 48.3),
        "m",
    ),
    Case(
        "two of five without geoid",
        half_geoid,
        r"stand beside|control point G0[12]|left out: G0",
        (-0.3, -48.3),
        "m",
    ),
    Case("all without geoid", all_geoid, r"geoid|shift|height", (0.3, 5.0, 48.3), "m", (), True),
    Case("camera constant off, held", camera_off(True), r"interior", (0.05, 0.5, 2.0), "%"),
    Case("camera constant off", camera_off(False), r"(?!)", (2.0,), "%", (2.0,)),
    Case("images renamed", renamed, r"names?|numbers?|order", (0.0, 1.0, 5.0)),
    Case("numbers off", number_off, r"order of time|\d off|names?|numbers?", (1.0, 3.0)),
    Case("rows in another order", shuffled, r"numbered|exchange their names|order of time"),
    Case("ground control in feet", ground_as(lambda X: X / 0.3048), r"feet"),
    Case("ground heights in feet", ground_as(lambda X: X / [1, 1, 0.3048]), r"feet"),
    Case("easting and northing exchanged", ground_as(lambda X: X[:, [1, 0, 2]]), r"exchanged"),
    Case("two control points exchanged", two_exchanged, r"G02|G04"),
    Case(
        "events late",
        late,
        r"delay of the exposures (of|looks)",
        (0.001, 0.02, 0.1, 1.0),
        "s",
        (0.001,),
    ),
    Case(
        "sigmas of positions",
        sigmas_as,
        r"too small|better than stated|another unit",
        (1e-3, 0.1, 10.0, 1e3),
        "times",
    ),
    Case(
        "wrong ambiguity of a line",
        ambiguity,
        r"line from",
        (0.005, 0.04, 0.27, 1.0),
        "m",
        (0.005,),
    ),
)


@dataclass(frozen=True)
class Run:
    """How one run ended."""

    case: str
    kind: str
    verdict: str
    code: int
    message: str
    worst_m: float = np.nan
    z: float = np.nan
    seconds: float = 0.0


BLAME = r"lever arm of .* explains|unmodelled lever arm|shift of ground control of .* explains"
BLAME += r"|unmodelled shift of ground control|other datum|with lever arm estimated|by a lever arm"


def judged(block: Block, case: Case, size: float, kind: str) -> Run:
    """Adjust and judge."""
    with tempfile.TemporaryDirectory() as temporary:
        directory = Path(temporary)
        command = written(block, directory)
        out, err, start = io.StringIO(), io.StringIO(), time.monotonic()
        try:
            with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
                code = insgnss(command)
        except Exception:
            err.write(traceback.format_exc())
            code = 1
        taken = time.monotonic() - start
        name = f"{case.name} {size:g} {case.unit}".strip()
        text = " ".join(r for r in out.getvalue().splitlines() if not r.startswith("wrote "))
        refusal = err.getvalue().replace(str(directory), "").strip()
        calm, worst, z = False, np.nan, np.nan
        text = text.split("Notes")[0]
        message = refusal or text
        if code not in (0, 2, 3, 4):
            return Run(name, kind, "traceback", code, refusal[-400:], seconds=taken)
        if code == 0:
            document = json.loads((directory / "out/adjust.json").read_text())
            calm = document["verdict"] == "consistent"
            worst, z = compared(directory / "out/eo.json", block)
            calm &= not document["findings"] or all(f["rank"] < 0.99 for f in document["findings"])
            found = [f for f in document["findings"] if f["rank"] >= 0.3]
            message = " / ".join(f"{f['text']}; {f['help']}" for f in found)
        covered = not (worst > NEED_M and z > WORST_Z)
        if size in case.harmless:
            verdict = "wrongly" if not calm else "covered" if covered else "silent"
        elif calm:
            named = bool(case.culprit and re.search(case.culprit, message))
            verdict = "covered" if covered else "disclosed" if named else "silent"
        elif re.search(case.culprit, message):
            verdict = "culprit"
        else:
            verdict = "told"
        if verdict == "told" and not case.blames and re.search(BLAME, message):
            verdict = "blamed"
        return Run(name, kind, verdict, code, message, worst, z, taken)


def compared(path: Path, block: Block) -> tuple[float, float]:
    """Return the largest error of a position that is beyond its sigmas, m, and in sigmas."""
    eo = read_eo(path)
    e, cov = errors_of(eo.images, eo.position_m, eo.C_mc, TangentPlane(*eo.origin), block), eo.cov
    z = np.abs(e / np.sqrt(np.diagonal(cov, axis1=1, axis2=2)))
    beyond = np.where(z[:, :3] > WORST_Z, np.abs(e[:, :3]), 0.0)
    return float(beyond.max()), float(z[:, :3].max())


def errors_of(
    images: tuple[str, ...], X: Array, C: Array, plane: TangentPlane, block: Block
) -> Array:
    """Return truth minus estimate (n, 6) in the axes of the estimate."""
    row = {name: k for k, name in enumerate(block.names)}
    rows = [row[name] for name in images]
    truth = TangentPlane(*ORIGIN)
    true_X = plane.position_from_geodetic(*truth.geodetic_from_position(block.true_X[rows]))
    true_C = plane.C_em.T @ truth.C_em @ block.true_C[rows]
    return np.hstack([true_X - X, vector_from_rotation(true_C @ C.swapaxes(1, 2))])


def perform(job: tuple[int, float, str, int]) -> Run:
    """Run one case."""
    k, size, kind, seed = job
    case = CASES[k]
    block = block_of(kind, seed)
    case.plant(block, size, np.random.default_rng([seed, k]))
    return judged(block, case, size, kind)


def good(job: tuple[str, int, float]) -> dict[str, Any]:
    """Adjust a good block; return normalised squares, their degrees of freedom, the verdict."""
    kind, seed, correlated = job
    block = block_of(kind, seed, correlated)
    with tempfile.TemporaryDirectory() as temporary:
        directory = Path(temporary)
        words = written(block, directory)
        shifts = words[words.index("--shift-sigma") + 1 :][:3] if correlated else []
        shift = f"shift_sigma_m = [{', '.join(shifts)}]" if correlated else ""
        shift += f"\nshift_correlation_s = {CORRELATION_S}" if correlated else ""
        (directory / "block.toml").write_text(
            '[images]\nfile = "image_points.csv"\n[camera]\nfile = "camera.toml"\n'
            '[aerial_control]\nfile = "Timestamp.MRK"\ninitial = "EO.txt"\n'
            f'{shift}\n[ground]\nfile = "ground.csv"\ncrs = "{CRS}"\n'
        )
        done = adjust(load_block(directory / "block.toml"), write=False)
    solved = done.solved
    values, precision, inner = solved.result.values, solved.precision, solved.result.problem.block
    assert solved.inputs.eo is not None
    plane = TangentPlane(*solved.inputs.eo.origin)
    e = errors_of(inner.images, values.position, values.C_mc, plane, block)
    poses = np.einsum("ni,nij,nj->n", e, np.linalg.inv(precision.pose_cov), e)
    columns = solved.result.problem.layout.columns
    off = (CAMERA.interior - values.interior[0])[columns]
    camera = float(off @ np.linalg.solve(precision.cov(("camera", 0)), off))
    truth = TangentPlane(*ORIGIN)
    true = np.array([block.true_point[name] for name in inner.points])
    true = plane.position_from_geodetic(*truth.geodetic_from_position(true))
    some = np.random.default_rng(seed).permutation(len(inner.points))[:40]
    d = (true - values.point)[some]
    cov = np.array([precision.cov(("point", int(p))) for p in some])
    points = np.einsum("ni,nij,nj->n", d, np.linalg.inv(cov), d)
    middle = len(poses) // 2
    return {
        "pose": (float(poses[middle]), 6),
        "poses, mean": (float(poses.mean()), 6),
        "camera": (camera, columns.size),
        "point": (float(np.nan_to_num(points)[0]), 3),
        "points, mean": (float(np.nanmean(points)), 3),
        "verdict": done.figures["verdict"],
        "headline": done.judgement.headline,
    }


def good_blocks(count: int, seed: int, processes: int) -> int:
    """Adjust good blocks, and print what all of them say together."""
    kinds = tuple(PLANS)
    shares = (0.0, 0.0, 0.5, 0.9)
    jobs = [(kinds[k % 3], seed + k, shares[k // 3 % 4]) for k in range(count)]
    rows = []
    with ProcessPoolExecutor(processes) as pool:
        for job, one in zip(jobs, pool.map(good, jobs), strict=True):
            rows.append((job, one))
            shown = ", ".join(
                f"{name} {one[name][0] / one[name][1]:.2f}" for name in one if name[0] in "pc"
            )
            print(job, shown, one["verdict"], flush=True)
            if one["verdict"] != "consistent":
                print("   ", one["headline"])
    for share in (None, 0.0, 0.5, 0.9):
        mine = [one for job, one in rows if share is None or job[2] == share]
        print("all" if share is None else f"share of the variance that errs slowly: {share:g}")
        for name in ("pose", "camera", "point", "poses, mean", "points, mean"):
            degrees = sum(one[name][1] for one in mine)
            total = sum(one[name][0] for one in mine)
            low, high = chi2.ppf((0.005, 0.995), degrees) / degrees
            bounds = "" if "mean" in name else f"   99 % of chance: {low:.2f} to {high:.2f}"
            print(f"    {name:<14}{total / degrees:6.3f}{bounds}")
    wrong = sum(one["verdict"] != "consistent" for _, one in rows)
    print(f"called contradictory: {wrong} of {len(rows)}")
    return 1 if wrong else 0


def row(one: Run) -> str:
    """A line of the table."""
    off = "" if np.isnan(one.worst_m) else f"{1e3 * one.worst_m:.0f} mm"
    z = "" if np.isnan(one.z) else f"{one.z:.1f}"
    message = textwrap.shorten(one.message.replace("|", "/"), 420, placeholder=" ...")
    return f"| {one.case} | {one.kind} | {one.verdict} | {one.code} | {off} | {z} | {message} |"


def main() -> int:
    """Run the campaign."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", default="", metavar="WORD")
    parser.add_argument("--kind", choices=tuple(PLANS), action="append")
    parser.add_argument("--seed", type=int, default=500)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--good", type=int, default=0, metavar="N", help="good blocks alone")
    parser.add_argument("--processes", type=int, default=1)
    options = parser.parse_args()
    if options.good:
        return good_blocks(options.good, options.seed, options.processes)
    kinds = options.kind or tuple(PLANS)
    jobs = [
        (k, size, kind, options.seed + s)
        for s in range(options.seeds)
        for k, case in enumerate(CASES)
        for size in case.sizes
        for kind in case.kinds
        if kind in kinds and options.only in case.name
    ]
    runs = []
    with ProcessPoolExecutor(options.processes) as pool:
        for one in pool.map(perform, jobs):
            runs.append(one)
            print(f"{one.seconds:5.1f} s {row(one)}", flush=True)
    counts = Counter(one.verdict for one in runs)
    print(", ".join(f"{word} {counts[word]}" for word in VERDICTS))
    return 1 if any(one.verdict in BAD for one in runs) else 0


if __name__ == "__main__":
    sys.exit(main())
