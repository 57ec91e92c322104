"""Figures of an adjusted block: everything that adjust.json, the page and the sentences show."""

from typing import Any

import numpy as np

from ...base import __version__
from ...base.files import picked
from ...geodesy.rotation import vector_from_rotation
from ...records.block import INTERIOR, ImageBlock
from ...records.relative import GAP_S
from ..adjust.adjustment import residuals_px
from ..adjust.aerial import DRIFT, SHIFT
from ..adjust.precision import NONCENTRALITY, strongest
from ..adjust.relative import RelativeAerialControl
from ..adjust.separation import inseparable
from ..adjust.unknowns import CAMERA, POINT
from .aerial.relative import weakly_held
from .parameters import MOUNTING, estimates
from .residuals.check_points import CheckPoints, check_points
from .solve import GROUND, Solved
from .vehicle.verdict import vehicle_figures


def figures_of(solved: Solved) -> dict[str, Any]:
    """Return the figures of an adjusted block.

    Parameters
    ----------
    solved : Solved
        The block.

    Returns
    -------
    dict
        As data_specs/adjust_json.md has it; SI, pixels, radians where a name does not say degrees.
    """
    block, result = solved.result.problem.block, solved.result
    checks = check_points(solved)
    return {
        "format": "insgnss adjustment",
        "format_version": 1,
        "software": f"insgnss {__version__}",
        "name": solved.inputs.file.name,
        "counts": _counts(solved),
        "iterations": solved.iterations,
        "redundancy": result.redundancy,
        "sigma0": result.sigma0,
        "mode": solved.inputs.file.adjustment.mode,
        "covariance_of_aerial_control": solved.control.covariance,
        "weakly_held": [
            {
                "image": block.images[datum.image],
                "images": datum.held,
                "position": bool(np.isfinite(datum.sigma[0])),
                "attitude": bool(np.isfinite(datum.sigma[1])),
            }
            for datum in weakly_held(result.problem.groups, solved.precision.groups)
        ],
        "components": _components(solved),
        "cameras": _cameras(solved),
        "mounting": _mounting(solved),
        "flight_lines": _lines(solved),
        "ground_control": _control(solved),
        "rejected_ground_control": [
            {"point": c.point, "residual_m": c.off_m.tolist(), "w": c.w}
            for c in solved.rejected_control
        ],
        "vehicle": vehicle_figures(solved),
        "check_points": _check(solved, checks),
        "check_points_together": {
            "normalised_square": checks.normalised_square,
            "degrees_of_freedom": int(checks.difference_m.size),
        }
        | _statistics(checks),
        "images": _images(solved),
        "correlations": [
            picked(c, "first", "second", "remedy") | {"correlation": c.value}
            for c in inseparable(solved.precision)
        ],
        "rejected": _rejected(solved),
        "strongest": [
            {"image": image, "point": point, "w": w}
            for image, point, w in strongest(solved.precision)
        ],
        "notes": [*solved.inputs.notes, *_weighed(solved), *_paired(solved)],
        "block_file": solved.inputs.file.resolved(),
        "points": _points(solved, block),
    }


def _weighed(solved: Solved) -> list[str]:
    """Say that standard deviations are too small where flight lines weigh without their own."""
    if solved.control.covariance not in ("chain", "image"):
        return []
    how = {"chain": "by covariances of neighbours alone", "image": "each image alone"}
    options = solved.inputs.file.aerial_control
    if options.positions_alone:
        if options.shift_sigma_m is not None:
            return []
        return [
            "positions are weighed as if each image had errors of its own: those of RTK and PPK"
            " last for minutes, and so sigmas are too small where --shift-sigma (shift_sigma_m)"
            " does not give each flight line its shift"
        ]
    return [
        f"the aerial control weighs {how[solved.control.covariance]}: standard deviations of"
        " bore-sight and camera are too small, several times in long flights; put the"
        " eo_covariance.npz of the same run beside eo.json"
    ]


def _paired(solved: Solved) -> list[str]:
    """Say how many neighbours are observed relative to each other, and how far apart."""
    eo, options = solved.inputs.eo, solved.inputs.file.aerial_control
    groups = [g for g in solved.result.problem.groups if isinstance(g, RelativeAerialControl)]
    if eo is None or not (count := sum(len(g.observed.pairs) for g in groups)):
        return []
    interval_s = np.concatenate(
        [g.time[g.observed.pairs[:, 1]] - g.time[g.observed.pairs[:, 0]] for g in groups]
    )
    images = sum(len(g.images) for g in groups)
    weighing = {
        "smoothed": "the covariance of whole flight lines",
        "independent": "images as if they were independent (paper 003, equation 5)",
        "gyro": "noise and drift of the gyroscopes (paper 003, equation 6)",
    }[options.relative_weights]
    text = (
        f"relative control: {count} pairs of neighbours among {images} images, up to"
        f" {interval_s.max():.1f} s apart; none across turns and gaps; weighed by {weighing}"
    )
    if options.relative_weights == "gyro" and interval_s.max() > GAP_S:
        text += f", which holds up to {GAP_S:g} s"
    return [text]


def _counts(solved: Solved) -> dict[str, int]:
    problem, inputs = solved.result.problem, solved.inputs
    return {
        "images": len(problem.block.images),
        "with_aerial_control": int((inputs.eo_row >= 0).sum()),
        "cameras": len(problem.block.cameras),
        "points": int(np.isfinite(solved.result.values.point[:, 0]).sum()),
        "image_observations": int(problem.rays.active.sum()),
        "rejected": int(solved.rejected.size),
        "without_part": len(problem.block.observations)
        - int(problem.rays.active.sum())
        - int(solved.rejected.size),
        "ground_control": len(problem.block.control),
        "kinematic_ground_control": 0 if inputs.vehicle is None else len(inputs.vehicle.images),
        "check_points": len(problem.block.check),
        "flight_lines": len(solved.control.lines),
    }


def _components(solved: Solved) -> list[dict[str, Any]]:
    return [
        {
            **picked(c, "name", "observations", "redundancy"),
            "variance": None if np.isnan(c.variance) else c.variance,
            "factor": solved.factors.get(c.name, 1.0),
        }
        for c in solved.components
    ]


def _cameras(solved: Solved) -> list[dict[str, Any]]:
    """Interior orientations with standard deviations, and how well a ray of a corner is known."""
    values, block = solved.result.values, solved.result.problem.block
    layout = solved.result.problem.layout
    out = []
    for c, camera in enumerate(block.cameras):
        sigma = solved.precision.sigma_interior(c)
        cov = solved.precision.cov((CAMERA, c)) if layout.columns.size else np.zeros((0, 0))
        names = [INTERIOR[k] for k in layout.columns]
        root = np.sqrt(np.maximum(np.diagonal(cov), 1e-300))
        out.append(
            {
                **picked(camera, "name", "width", "height", "unit_px", "model"),
                "images": int((block.camera == c).sum()),
                "parameters": {
                    name: {
                        "value": float(values.interior[c, k]),
                        "first": float(camera.interior[k]),
                        "sigma": float(sigma[k]) if name in camera.free else None,
                        "estimated": name in camera.free,
                    }
                    for k, name in enumerate(INTERIOR)
                },
                "correlated": names,
                "correlation": (cov / root / root[:, None]).tolist(),
            }
        )
    return out


def _mounting(solved: Solved) -> dict[str, Any]:
    """Parameters between trajectory and camera with sigmas and those that were stated before."""
    file = solved.inputs.file
    where = "block file" if file.aerial_control.positions_alone else "flight file"
    mounting = estimates(file, MOUNTING, solved.precision)
    return {name: estimate | {"stated_in": where} for name, estimate in mounting.items()}


def _lines(solved: Solved) -> list[dict[str, Any]]:
    images, blocks = solved.result.problem.block.images, solved.result.values.blocks
    out = []
    for k, rows in enumerate(solved.control.lines):
        line_figures: dict[str, Any] = {
            "first_image": images[rows[0]],
            "last_image": images[rows[-1]],
            "images": int(rows.size),
            "control": solved.control.of_lines[k],
        }
        for name in (SHIFT, DRIFT):
            if (name, k) in blocks:
                line_figures[name] = blocks[(name, k)].tolist()
                cov = solved.precision.cov((name, k))
                line_figures[f"sigma_{name}"] = np.sqrt(np.diagonal(cov)).tolist()
        out.append(line_figures)
    return out


def _control(solved: Solved) -> list[dict[str, Any]]:
    problem = solved.result.problem
    names = problem.block.points
    rays = solved.result.problem.ray_count
    out = []
    for test in solved.precision.groups:
        if test.name != GROUND:
            continue
        row = test.keys[0][1]
        out.append(
            {
                "point": names[row],
                "images": int(rays[row]),
                "residual_m": test.e.tolist(),
                "redundancy": test.redundancy.tolist(),
                "w": test.w.tolist(),
                "detectable_m": [float(x) if np.isfinite(x) else None for x in test.detectable],
                "position_m": solved.result.values.point[row].tolist(),
                "sigma_m": np.sqrt(np.diagonal(solved.precision.cov((POINT, row)))).tolist(),
            }
        )
    return out


def _check(solved: Solved, checks: CheckPoints) -> list[dict[str, Any]]:
    """Check points: surveyed - adjusted, with the standard deviation of this difference."""
    block, point = solved.result.problem.block, solved.result.values.point
    rays = solved.result.problem.ray_count
    out: list[dict[str, Any]] = [
        {"point": block.points[row], "images": int(rays[row])} for row in block.check.point
    ]
    for k, (check_row, d) in enumerate(zip(checks.rows, checks.difference_m, strict=True)):
        P = checks.cov[3 * k : 3 * k + 3, 3 * k : 3 * k + 3]
        total = P + checks.survey[k]
        out[check_row] |= {
            "difference_m": d.tolist(),
            "sigma_m": np.sqrt(np.diagonal(total)).tolist(),
            "sigma_adjusted_m": np.sqrt(np.diagonal(P)).tolist(),
            "normalised_square": float(d @ np.linalg.solve(total, d)),
            "position_m": point[block.check.point[check_row]].tolist(),
        }
    return out


def _statistics(checks: CheckPoints) -> dict[str, list[float] | None]:
    """Return mean, root mean square and largest difference of each coordinate, m."""
    d = checks.difference_m
    if not d.size:
        return {"mean_m": None, "rms_m": None, "largest_m": None}
    largest = d[np.abs(d).argmax(axis=0), np.arange(3)]
    return {
        "mean_m": d.mean(axis=0).tolist(),
        "rms_m": np.sqrt((d**2).mean(axis=0)).tolist(),
        "largest_m": largest.tolist(),
    }


def _images(solved: Solved) -> list[dict[str, Any]]:
    """Images: residuals, standard deviations, and how far the aerial control was off."""
    problem, values = solved.result.problem, solved.result.values
    block, eo, row = problem.block, solved.inputs.eo, solved.inputs.eo_row
    e = residuals_px(solved.result)
    taking = np.isfinite(solved.precision.redundancy[:, 0])
    image = block.observations.image
    n = len(block.images)
    count = np.bincount(image[taking], minlength=n)
    square = np.bincount(image[taking], (e[taking] ** 2).sum(axis=1), n)
    rejected = np.bincount(image[solved.rejected], minlength=n)
    sigma = np.sqrt(np.maximum(np.diagonal(solved.precision.pose_cov, axis1=1, axis2=2), 0.0))
    out = []
    for i, name in enumerate(block.images):
        image_figures: dict[str, Any] = {
            "image": name,
            "observations": int(count[i]),
            "rejected": int(rejected[i]),
            "rms_px": float(np.sqrt(square[i] / (2 * count[i]))) if count[i] else None,
            "position_m": values.position[i].tolist(),
            "sigma_m": sigma[i, :3].tolist(),
            "sigma_rad": sigma[i, 3:].tolist(),
        }
        if eo is not None and row[i] >= 0:
            image_figures["moved_m"] = (values.position[i] - eo.position_m[row[i]]).tolist()
            turn = values.C_mc[i] @ eo.C_mc[row[i]].T
            image_figures["turned_rad"] = vector_from_rotation(turn).tolist()
        out.append(image_figures)
    return out


def _rejected(solved: Solved) -> list[dict[str, Any]]:
    block = solved.result.problem.block
    e = residuals_px(solved.result)
    observations = block.observations
    return [
        {
            "image": block.images[observations.image[k]],
            "point": block.points[observations.point[k]],
            "residual_px": [float(x) if np.isfinite(x) else None for x in e[k]],
        }
        for k in solved.rejected
    ]


def _points(solved: Solved, block: ImageBlock) -> dict[str, Any]:
    """Return the median standard deviations of all object points, and of minimal biases."""
    sigma = solved.precision.point_sigma
    finite = np.isfinite(sigma).all(axis=1)
    detectable = solved.precision.detectable_px
    mask = np.isfinite(detectable)
    return {
        "median_sigma_m": np.median(sigma[finite], axis=0).tolist() if finite.any() else None,
        "median_detectable_px": float(np.median(detectable[mask])) if mask.any() else None,
        "detectable_of_sigmas": NONCENTRALITY,
        "heights_m": [
            float(x)
            for x in np.nanquantile(solved.result.values.point[:, 2], (0.02, 0.5, 0.98)).tolist()
        ]
        if block.points
        else None,
    }
