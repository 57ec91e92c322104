"""Figures of an adjusted block: everything that adjust.json, the page and the sentences show."""

from collections.abc import Iterable, Mapping
from typing import Any, cast

import numpy as np

from ...base import __version__
from ...base.files import json_ready, pick_attributes
from ...geodesy.rotation import vector_from_rotation
from ...records.block import INTERIOR, Array, ImageBlock
from ...records.relative import GAP_S
from ..adjust.adjustment import residuals_px
from ..adjust.aerial import LINE_DRIFT, SHIFT
from ..adjust.kinematic import KinematicControl, TargetSize
from ..adjust.precision import NONCENTRALITY, strongest
from ..adjust.relative import RelativeAerialControl
from ..adjust.separation import inseparable
from ..adjust.unknowns import CAMERA, POINT
from .aerial.relative import weakly_held
from .parameters import MOUNTING_PARAMETERS, VEHICLE_PARAMETERS, estimates
from .residuals.check_points import CheckPoints, check_points
from .solve import GROUND_CONTROL, AdjustedBlock


def figures_of(solved: AdjustedBlock) -> dict[str, Any]:
    """Return the figures of an adjusted block.

    Parameters
    ----------
    solved : AdjustedBlock
        The block.

    Returns
    -------
    dict
        As data_specs/adjust_json.md has it; SI, pixels, radians where a name does not say degrees.
    """
    block, result = solved.result.problem.block, solved.result
    checks = check_points(solved)
    figures = {
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
                "position": np.isfinite(datum.sigma[0]),
                "attitude": np.isfinite(datum.sigma[1]),
            }
            for datum in weakly_held(result.problem.groups, solved.precision.groups)
        ],
        "components": _components(solved),
        "cameras": _cameras(solved),
        "mounting": _mounting(solved),
        "flight_lines": _lines(solved),
        "ground_control": _control(solved),
        "rejected_ground_control": [
            {"point": c.point, "residual_m": c.off_m, "w": c.w} for c in solved.rejected_control
        ],
        "vehicle": _vehicle(solved),
        "check_points": _check(solved, checks),
        "check_points_together": {
            "normalised_square": checks.normalised_square,
            "degrees_of_freedom": int(checks.difference_m.size),
            "contradicts_alone": None
            if (alone := checks.contradicts_alone) is None
            else block.points[block.check.point[checks.rows[alone]]],
        }
        | _statistics(checks),
        "images": _images(solved),
        "correlations": [
            pick_attributes(c, "first", "second", "remedy") | {"correlation": c.value}
            for c in inseparable(solved.precision)
        ],
        "rejected": _rejected_figures(solved),
        "strongest": [
            {"image": image, "point": point, "w": w}
            for image, point, w in strongest(solved.precision)
        ],
        "notes": [*solved.inputs.notes, *_weights_sentence(solved), *_pairs_sentence(solved)],
        "block_file": solved.inputs.file.resolved(),
        "points": _points(solved, block),
    }
    return cast(dict[str, Any], json_ready(figures))


def _weights_sentence(solved: AdjustedBlock) -> list[str]:
    """Say that standard deviations are too small where flight lines weigh without their own."""
    if solved.control.covariance not in ("chain", "image"):
        return []
    how = {"chain": "by covariances of neighbours alone", "image": "each image alone"}
    options = solved.inputs.file.aerial_control
    if options.positions_alone:
        if options.shift_sigma_m is not None:
            return []
        return [
            "positions are weighted as if the errors of images were independent: those of RTK"
            " and PPK last for minutes, so that sigmas are too small unless --shift-sigma"
            " (shift_sigma_m) estimates a shift of each flight line"
        ]
    return [
        f"the aerial control weighs {how[solved.control.covariance]}: standard deviations of"
        " bore-sight and camera are too small, several times in long flights; put the"
        " eo_covariance.npz of the same run beside eo.json"
    ]


def _pairs_sentence(solved: AdjustedBlock) -> list[str]:
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


def _counts(solved: AdjustedBlock) -> dict[str, int]:
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


def _rows(columns: Mapping[str, Iterable[Any]]) -> list[dict[str, Any]]:
    """Return the rows of columns of one length, each by the names of the columns."""
    rows = zip(*columns.values(), strict=True)
    return [dict(zip(columns, row, strict=True)) for row in rows]


def _components(solved: AdjustedBlock) -> list[dict[str, Any]]:
    return [
        pick_attributes(c, "name", "observations", "redundancy", "variance")
        | {"factor": solved.factors.get(c.name, 1.0)}
        for c in solved.components
    ]


def _cameras(solved: AdjustedBlock) -> list[dict[str, Any]]:
    """Interior orientations with standard deviations, and how well a ray of a corner is known."""
    values, block = solved.result.values, solved.result.problem.block
    columns = solved.result.problem.layout.columns
    out = []
    for c, camera in enumerate(block.cameras):
        sigma = solved.precision.sigma_interior(c)
        estimated = np.isin(INTERIOR, camera.free)
        of_parameters = {
            "value": values.interior[c],
            "first": camera.interior,
            "sigma": np.where(estimated, sigma, np.nan),
            "estimated": estimated,
        }
        cov = solved.precision.cov((CAMERA, c)) if columns.size else np.zeros((0, 0))
        root = np.sqrt(np.maximum(np.diagonal(cov), 1e-300))
        out.append(
            {
                **pick_attributes(camera, "name", "width", "height", "unit_px", "model"),
                "images": int((block.camera == c).sum()),
                "parameters": dict(zip(INTERIOR, _rows(of_parameters), strict=True)),
                "correlated": [INTERIOR[k] for k in columns],
                "correlation": cov / root / root[:, None],
            }
        )
    return out


def _mounting(solved: AdjustedBlock) -> dict[str, Any]:
    """Parameters between trajectory and camera with sigmas and those that were stated before."""
    file = solved.inputs.file
    where = "block file" if file.aerial_control.positions_alone else "flight file"
    mounting = estimates(file, MOUNTING_PARAMETERS, solved.precision)
    return {name: estimate | {"stated_in": where} for name, estimate in mounting.items()}


def _lines(solved: AdjustedBlock) -> list[dict[str, Any]]:
    images, blocks = solved.result.problem.block.images, solved.result.values.blocks
    control = solved.control
    out = _rows(
        {
            "first_image": [images[rows[0]] for rows in control.lines],
            "last_image": [images[rows[-1]] for rows in control.lines],
            "images": [rows.size for rows in control.lines],
            "control": control.of_lines,
        }
    )
    for k, line in enumerate(out):
        for name in (SHIFT, LINE_DRIFT):
            if (name, k) in blocks:
                sigma = np.sqrt(np.diagonal(solved.precision.cov((name, k))))
                line |= {name: blocks[(name, k)], f"sigma_{name}": sigma}
    return out


def _control(solved: AdjustedBlock) -> list[dict[str, Any]]:
    problem, point = solved.result.problem, solved.result.values.point
    tests = [test for test in solved.precision.groups if test.name == GROUND_CONTROL]
    rows = [test.keys[0][1] for test in tests]
    cov = [solved.precision.cov((POINT, row)) for row in rows]
    control = problem.block.control
    unknown = dict(zip(control.point.tolist(), control.unknown, strict=True))
    stated = [~unknown.get(row, np.zeros(3, dtype=bool)) for row in rows]
    pairs = list(zip(tests, stated, strict=True))
    return _rows(
        {
            "point": [problem.block.points[row] for row in rows],
            "images": problem.ray_count[rows],
            "residual_m": [np.where(k, test.e, np.nan) for test, k in pairs],
            "redundancy": [test.redundancy for test in tests],
            "w": [test.w for test in tests],
            "detectable_m": [np.where(k, test.detectable, np.nan) for test, k in pairs],
            "position_m": point[rows],
            "sigma_m": [np.sqrt(np.diagonal(P)) for P in cov],
        }
    )


def _vehicle(solved: AdjustedBlock) -> dict[str, Any] | None:
    """Kinematic ground control; None without a vehicle."""
    if (vehicle := solved.inputs.vehicle) is None:
        return None
    problem, n = solved.result.problem, len(vehicle.images)
    _, rows, rays = vehicle.rows_in(problem.block)
    tests = list(zip(problem.stated_groups, solved.precision.groups, strict=True))
    (places,) = (test for group, test in tests if isinstance(group, KinematicControl))
    points = _rows(
        {
            "image": vehicle.images,
            "point": vehicle.points,
            "residual_m": places.e.reshape(n, 3),
            "redundancy": places.redundancy.reshape(n, 3),
            "w": places.w.reshape(n, 3),
            "residual_px": residuals_px(solved.result)[rays],
            "left_out": ~problem.active[rays],
            "sigma_before_m": np.sqrt(np.diagonal(vehicle.cov)).reshape(n, 3),
        }
    )
    sizes = {g.point: (g.size_px, test) for g, test in tests if isinstance(g, TargetSize)}
    for row, figures in zip(rows.tolist(), points, strict=True):
        if row in sizes:
            size, test = sizes[row]
            figures |= {"size_px": size, "size_residual_px": test.e[0], "size_w": test.w[0]}
    return {
        "file": str(vehicle.options.file),
        "kind": vehicle.track.kind,
        "exposures": n,
        "left_out": sum(p["left_out"] for p in points),
        "sizes": len(sizes),
        "parameters": estimates(solved.inputs.file, VEHICLE_PARAMETERS, solved.precision),
        "points": points,
    }


def _check(solved: AdjustedBlock, checks: CheckPoints) -> list[dict[str, Any]]:
    """Check points: surveyed - adjusted, with the standard deviation of this difference."""
    block, point = solved.result.problem.block, solved.result.values.point
    rows = block.check.point
    images = solved.result.problem.ray_count[rows]
    out = _rows({"point": [block.points[row] for row in rows], "images": images})
    for k, (check_row, d) in enumerate(zip(checks.rows, checks.difference_m, strict=True)):
        P = checks.cov[3 * k : 3 * k + 3, 3 * k : 3 * k + 3]
        total = P + checks.survey[k]
        out[check_row] |= {
            "difference_m": d,
            "sigma_m": np.sqrt(np.diagonal(total)),
            "sigma_adjusted_m": np.sqrt(np.diagonal(P)),
            "normalised_square": d @ np.linalg.solve(total, d),
            "position_m": point[rows[check_row]],
        }
    return out


def _statistics(checks: CheckPoints) -> dict[str, Array | None]:
    """Return mean, root mean square and largest difference of each coordinate, m."""
    d = checks.difference_m
    if not d.size:
        return {"mean_m": None, "rms_m": None, "largest_m": None}
    largest = d[np.abs(d).argmax(axis=0), np.arange(3)]
    return {
        "mean_m": d.mean(axis=0),
        "rms_m": np.sqrt((d**2).mean(axis=0)),
        "largest_m": largest,
    }


def _images(solved: AdjustedBlock) -> list[dict[str, Any]]:
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
    with np.errstate(invalid="ignore"):  # of images without observations
        rms = np.sqrt(square / (2 * count))
    out = _rows(
        {
            "image": block.images,
            "observations": count,
            "rejected": rejected,
            "rms_px": rms,
            "position_m": values.position,
            "sigma_m": sigma[:, :3],
            "sigma_rad": sigma[:, 3:],
        }
    )
    if eo is not None:
        for i in np.flatnonzero(row >= 0):
            turn = values.C_mc[i] @ eo.C_mc[row[i]].T
            out[i]["moved_m"] = values.position[i] - eo.position_m[row[i]]
            out[i]["turned_rad"] = vector_from_rotation(turn)
    return out


def _rejected_figures(solved: AdjustedBlock) -> list[dict[str, Any]]:
    block, rows = solved.result.problem.block, solved.rejected
    return _rows(
        {
            "image": [block.images[i] for i in block.observations.image[rows]],
            "point": [block.points[p] for p in block.observations.point[rows]],
            "residual_px": residuals_px(solved.result)[rows],
        }
    )


def _points(solved: AdjustedBlock, block: ImageBlock) -> dict[str, Any]:
    """Return the median standard deviations of all object points, and of minimal biases."""
    sigma, detectable = solved.precision.point_sigma, solved.precision.detectable_px
    finite, mask = np.isfinite(sigma).all(axis=1), np.isfinite(detectable)
    heights = solved.result.values.point[:, 2]
    return {
        "median_sigma_m": np.median(sigma[finite], axis=0) if finite.any() else None,
        "median_detectable_px": np.median(detectable[mask]) if mask.any() else None,
        "detectable_of_sigmas": NONCENTRALITY,
        "heights_m": np.nanquantile(heights, (0.02, 0.5, 0.98)) if block.points else None,
    }
