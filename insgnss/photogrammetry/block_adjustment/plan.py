"""The dry run `insgnss adjust --plan`: what a block will determine, before anything is measured.

Images stand where the orientation has them (of a simulated flight, or one that was flown), tie
points are drawn on ground of the height that ground points or the block file give, and every pixel
is the one that collinearity gives: the adjustment stands at its solution, and its covariances are
those to expect. Variances are those of the block file and of the orientation.

One more ground control point is tried where the points are worst: the block is adjusted with it,
and what it gains is said. Where points are good enough everywhere, it gains little.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import InputError
from ...base.output.staging import together
from ...flight.config.block_file import BlockFile
from ...io.formats.blocks.ground_points import GroundTable
from ...io.formats.blocks.image_points import ImagePoints
from ...io.formats.blocks.joined import join_block
from ...io.formats.blocks.measured_block import of_table
from ...io.formats.orientation.eo_json import read_one_camera
from ...io.formats.returned.cameras import read_camera
from ...records import ExteriorOrientation
from ...records.block import BrownCamera, GroundPoints, ImageBlock, ImageObservations
from ...report.charts.chart import Chart
from ...report.document import Document, Section, write_with_page
from ...report.figures.block import precision_map
from ...report.notebook import Documented
from ...report.rules.wording import lengths, screen_unit
from ...report.verdict import worst_of
from ...simulation.image_block import BlockOptions, Terrain, Visible, seen_points, tie_points
from ..adjust.adjustment import Adjusted, redundancy_of, valid
from ..adjust.direct import direct_precision
from ..adjust.normals import cost
from ..adjust.precision import Precision, precision_of
from ..adjust.separation import NORMAL
from .aerial.control import Control, control_of
from .figures import figures_of
from .ground import ground_in_plane
from .inputs import BlockInputs, observed_camera
from .mode import cameras_in_mode, file_in_mode, ground_in_mode, source_in_mode
from .page import ground_of, input_files
from .solve import AdjustedBlock, set_up

PLAN_DOCUMENT, PLAN_PAGE = "plan.json", "plan.html"
SEED = 14  # of the tie points drawn, so that a plan gives the same numbers again (any)
WORTH_RATIO = 0.8  # of the largest sigma, from which on a control point is worth its survey
TARGET_PX = 0.3  # largest sigma of a target's image observation (chosen)
FLAT = Terrain(0.0, np.zeros(1), np.zeros((2, 1)), np.zeros(1))  # one wave without amplitude


@dataclass(frozen=True, eq=False)
class Plan(Documented):
    """What a block is expected to determine.

    Parameters
    ----------
    solved : AdjustedBlock
        The block at its solution.
    figures : dict
        As of an adjusted block, residuals are zero; next_control_point is where one more control
        point helps most, or None.
    """

    solved: AdjustedBlock
    figures: dict[str, Any]
    files: tuple[Path, ...] = ()

    def document(self, charts: Sequence[Chart] = ()) -> Document:
        """Return what to expect of the block.

        Parameters
        ----------
        charts : sequence of Chart
            Charts of the page.
        """
        counts, f = self.figures["counts"], self.figures
        return Document(
            f"{f['name']}: plan",
            f"planned: {counts['images']} images, {counts['points']} points,"
            f" {counts['image_observations']} image observations,"
            f" {counts['ground_control']} ground control, {counts['check_points']} check points",
            worst_of("this is what to expect, before anything is measured"),
            (
                *charts,
                Section(
                    "What to expect", [*self._precision(), *expected_accuracy(f), *self._advice()]
                ),
                Section("Notes", f["notes"]),
            ),
            input_files(self.solved),
            files=self.files,
        )

    def _precision(self) -> Iterator[str]:
        """Say how well object points and check points will be known."""
        sigma = self.solved.precision.point_sigma
        sigma = sigma[np.isfinite(sigma).all(axis=1)]
        yield (
            f"points: median sigmas {lengths((1e3 * np.median(sigma, axis=0)).tolist())} (E, N, U),"
            f" 95 % below {lengths((1e3 * np.quantile(sigma, 0.95, axis=0)).tolist())}"
        )
        checks = [c for c in self.figures["check_points"] if "sigma_adjusted_m" in c]
        if checks:
            s = np.sqrt(np.mean(np.square([c["sigma_adjusted_m"] for c in checks]), axis=0))
            yield f"check points: {lengths((1e3 * s).tolist())} expected"

    def _advice(self) -> Iterator[str]:
        """Say what will hardly be told apart, and what one more control point would gain."""
        for c in self.figures["correlations"]:
            if c["remedy"] not in ("", NORMAL):
                yield (
                    f"{c['first']} and {c['second']} will hardly be told apart (correlation"
                    f" {c['correlation']:+.2f}): {c['remedy']}"
                )
        if (best := self.figures["next_control_point"]) is not None:
            where, image = best["position_m"], best["image"]
            before, after = (best[f"largest_height_sigma_{when}_m"] for when in ("before", "after"))
            gain = "would help most" if _is_worth_it(best) else "would help little, even"
            yield (
                f"one more ground control point {gain} at E {where[0]:.0f}, N {where[1]:.0f} m"
                f" (near {image}): largest height sigma of points in three images"
                f" {lengths([1e3 * before])} without, {lengths([1e3 * after])} with it"
            )

    def as_dict(self) -> dict[str, Any]:
        """Return the document for machines."""
        return self.figures


def expected_accuracy(figures: Mapping[str, Any]) -> Iterator[str]:
    """Say how well cameras and mounting will be known.

    Parameters
    ----------
    figures : mapping
        Of the planned block.

    Yields
    ------
    str
        One sentence a camera and one for each part of the mounting.
    """
    height = figures["flying_height_m"]
    for camera in figures["cameras"]:
        estimated = {k: p for k, p in camera["parameters"].items() if p["estimated"]}
        if not estimated:
            yield f"camera {camera['name']}: nothing of it is estimated"
            continue
        sigmas = ", ".join(f"{k} {p['sigma']:.2g}" for k, p in estimated.items())
        text = f"camera {camera['name']}: sigmas {sigmas}"
        if "f" in estimated:
            of_height = 1e3 * height * estimated["f"]["sigma"] / estimated["f"]["value"]
            text += f"; that of f is {lengths([of_height])} of the flying height {height:.0f} m"
        yield text
    for name, estimated in figures["mounting"].items():
        factor, unit = screen_unit(estimated["unit"])
        sigma = " / ".join(f"{factor * x:.2g}" for x in estimated["sigma"])
        before = " / ".join(f"{factor * x:.2g}" for x in estimated["sigma_before"])
        yield f"{name}: sigma {sigma} {unit} ({before} before)"


def plan_block(file: BlockFile, progress: Callable[[str], None], out: Path | None = None) -> Plan:
    """Say what a block will determine.

    Parameters
    ----------
    file : BlockFile
        The block file; its image observations are not read.
    progress : callable
        Is called with the name of each step.
    out : Path, optional
        Directory of plan.json and plan.html; None: they are not written.

    Returns
    -------
    Plan
        The precision to expect.

    Raises
    ------
    InputError
        No orientation, no camera, or no height of the ground.
    DataError
        The block does not determine an unknown.
    """
    notes: list[str] = []
    file, mode = file_in_mode(file, notes), file.adjustment.mode
    options = file.aerial_control
    if options.file is None:
        raise InputError(
            "adjust --plan: the positions of the images are missing; give the eo.json of a"
            " flight, such as a simulated one"
        )
    if file.camera.file is None:
        raise InputError("adjust --plan: the camera is missing; give --camera, a camera.toml")
    progress("reading the orientation")
    eo = read_one_camera(options.file, "an adjustment")
    camera = read_camera(file.camera.file)
    if file.camera.free is not None:
        camera = replace(camera, free=file.camera.free)
    (camera,) = cameras_in_mode(file, [camera], notes)
    ground = ground_in_plane(file, None, eo, [])
    terrain = replace(FLAT, height_m=_ground_height(file, ground))
    if file.vehicle.file is not None:
        notes.append("the plan ignores the vehicle: it has no kinematic ground control")
    progress("drawing tie points")
    block = _block(file, eo, camera, ground, terrain)
    source = of_table(*block)
    ground = ground_in_mode(file, ground, source.measured.points, notes)
    source = source_in_mode(mode, source, ground, notes)
    union = join_block(source, ground, eo, all_oriented=mode == "fast_at")
    inputs = BlockInputs(
        file,
        union.block,
        eo,
        union.eo_row,
        tuple(notes),
        observed_camera(file, union.block),
    )
    progress(f"adjusting {len(union.block.observations)} planned image observations")
    control = control_of(inputs)
    none = np.zeros(0, dtype=np.int64)
    solved = AdjustedBlock(inputs, control, _precision(inputs, control), {}, none, (), 0)
    figures = figures_of(solved)
    figures["flying_height_m"] = float(np.median(eo.position_m[:, 2])) - terrain.height_m
    figures["next_control_point"] = None
    if mode != "direct":
        progress("trying one more ground control point")
        figures["next_control_point"] = _next_point(solved, eo)
    plan = Plan(solved, figures)
    if out is None:
        return plan
    progress(f"writing {out}")
    return replace(plan, files=_write_plan(plan, out))


def _write_plan(plan: Plan, out: Path) -> tuple[Path, ...]:
    """Write document and page, both or none."""
    best = plan.figures["next_control_point"]
    chart = precision_map(
        plan.figures,
        ground_of(plan.solved),
        np.array(best["position_m"]) if best is not None and _is_worth_it(best) else None,
    )
    with together() as staging:
        into = staging.tree(out)
        write_with_page(
            plan.document([chart]), plan.as_dict(), into / PLAN_DOCUMENT, into / PLAN_PAGE
        )
        return staging.goals()


def _ground_height(file: BlockFile, ground: GroundTable | None) -> float:
    """Return the height of the ground in the tangent plane."""
    if file.plan.ground_m is not None:
        return file.plan.ground_m
    if ground is None or not ground.points:
        raise InputError(
            "adjust --plan: the height of the ground is missing; give ground points, or"
            " plan.ground_m (--ground-height), its height in m above the origin"
            " of the tangent plane"
        )
    return float(np.median(ground.position_m[:, 2]))


def _block(
    file: BlockFile,
    eo: ExteriorOrientation,
    camera: BrownCamera,
    ground: GroundTable | None,
    terrain: Terrain,
) -> tuple[ImagePoints, BrownCamera]:
    """Return planned image observations: tie points, and ground points where images see them."""
    plan = file.plan
    options = BlockOptions(
        tie_points=plan.tie_points, matched=plan.matched, true_camera=camera, stated_camera=camera
    )
    ties = tie_points(eo, terrain, options, np.random.default_rng(SEED))
    targets = ground.position_m if ground is not None else np.zeros((0, 3))
    visible = seen_points(eo, targets, camera)
    sigma = file.images.sigma_px or options.tie_sigma_px
    return _simulate_observations(
        eo, ties, visible, ground.points if ground is not None else (), sigma
    ), camera


def _simulate_observations(
    eo: ExteriorOrientation, ties: Visible, targets: Visible, names: tuple[str, ...], sigma: float
) -> ImagePoints:
    points = (*(f"T{k + 1:06d}" for k in range(len(ties.position))), *names)
    image = np.concatenate([ties.image, targets.image])
    point = np.concatenate([ties.point, targets.point + len(ties.position)])
    uv = np.vstack([ties.uv, targets.uv])
    is_target = point >= len(ties.position)
    s = np.where(is_target, min(sigma, TARGET_PX), sigma)[:, None] * np.ones(2)
    return ImagePoints(eo.images, points, ImageObservations(image, point, uv, s))


def _precision(inputs: BlockInputs, control: Control) -> Precision:
    """Return the precision at the solution, where pixels without error have the planned poses."""
    problem, values = set_up(inputs, control)
    problem = problem.with_active(valid(problem, values))
    point = np.where(problem.determined[:, None], values.point, np.nan)
    zero = cost(problem, values)[0]
    solution = Adjusted(problem, values.with_points(point), zero, 0, redundancy_of(problem))
    if inputs.file.adjustment.mode == "direct":
        return direct_precision(solution)
    return precision_of(solution, 1.0)


def _is_worth_it(point: Mapping[str, Any]) -> bool:
    """Tell whether a control point improves the largest sigma of heights enough for its survey."""
    before, after = point["largest_height_sigma_before_m"], point["largest_height_sigma_after_m"]
    return bool(after < WORTH_RATIO * before)


def _next_point(solved: AdjustedBlock, eo: ExteriorOrientation) -> dict[str, Any] | None:
    """Try one more control point where points that three images see are worst in height."""
    block = solved.result.problem.block
    rays = np.bincount(block.observations.point, minlength=len(block.points))
    sigma = solved.precision.point_sigma[:, 2]
    good = np.isfinite(sigma) & (rays >= 3)
    if not good.any():
        return None
    worst = int(np.argmax(np.where(good, sigma, -1.0)))
    X = solved.result.values.point[worst]
    control = block.control
    cov = np.median(control.cov, axis=0) if len(control) else np.diag([0.01, 0.01, 0.015]) ** 2
    more = GroundPoints(
        np.append(control.point, worst),
        np.vstack([control.position_m, X]),
        np.concatenate([control.cov, cov[None]]),
    )
    changed: ImageBlock = replace(block, control=more)
    again = _precision(replace(solved.inputs, block=changed), solved.control)
    after = float(again.point_sigma[good, 2].max())
    near = int(np.argmin(np.linalg.norm(eo.position_m[:, :2] - X[:2], axis=1)))
    return {
        "position_m": X.tolist(),
        "largest_height_sigma_before_m": float(sigma[worst]),
        "largest_height_sigma_after_m": after,
        "image": eo.images[near],
    }
