"""Products of an adjusted block, all of them or none; of one that contradicts itself too much only
adjust.json and the page, or where it is asked for, the others in a directory `contradicted`.

eo.json       orientation of the images with aerial control, which `insgnss export` takes
exports       as output.formats asks for
poses.csv     every image, also those without a stamp; poses_covariance.npz where it is asked for
points.csv    object points with covariances, and residuals.csv, where they are asked for
camera_*      cameras with standard deviations
mounting.toml tables that `insgnss process --mounting` takes
adjust.json   everything that was found
adjust.html   the page
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import InputError
from ...base.inputs import sha256
from ...base.output.staging import together
from ...base.provenance import made_from, refuse_overwriting
from ...geodesy.gpstime import calendar_from_gps
from ...geodesy.rotation import CV_RUB, nearest_rotation, opk_from_rotation, opk_jacobian
from ...io.formats.blocks.camera_files import write_cameras
from ...io.formats.blocks.camera_toml import write_camera_toml
from ...io.formats.orientation.exported import quoted_names
from ...io.formats.orientation.mounting_file import MountingFile, write_mounting_file
from ...io.formats.orientation.pose_covariance import POSES_COVARIANCE_FILE as COVARIANCE
from ...io.formats.orientation.pose_covariance import write_pose_covariance
from ...io.formats.text.columns import TableOut
from ...records import ExteriorOrientation
from ...records.block import INTERIOR, Array, BrownCamera, InteriorCovariance
from ...report.document import write_with_page
from ..adjust.adjustment import residuals_px
from ..adjust.aerial import BORESIGHT, CAMERA_LEVER_ARM, EXPOSURE_DELAY
from ..adjust.unknowns import CAMERA, POSE
from .aerial.control import processed_with
from .judgement import Judgement
from .page import charts_of, document_of, input_files
from .solve import AdjustedBlock

ADJUST_DOCUMENT, ADJUST_PAGE, MOUNTING_FILE, POSES_FILE = (
    "adjust.json",
    "adjust.html",
    "mounting.toml",
    "poses.csv",
)

POSE_TABLE = TableOut(
    "image x=%.4f y=%.4f z=%.4f omega=%.7f phi=%.7f kappa=%.7f sd_x=%.5f sd_y=%.5f sd_z=%.5f"
    " sd_omega=%.7f sd_phi=%.7f sd_kappa=%.7f aerial_control"
)
POINTS_TABLE = TableOut(
    "point x=%.4f y=%.4f z=%.4f sd_x=%.6f sd_y=%.6f sd_z=%.6f cov_xy=%.6e cov_xz=%.6e cov_yz=%.6e"
    " rays=%d role"
)
RESIDUALS = TableOut(
    "image point x=%.4f y=%.4f sigma_x=%.5f sigma_y=%.5f correlation=%.5f residual_x=%.5f"
    " residual_y=%.5f redundancy_x=%.5f redundancy_y=%.5f w_x=%.4f w_y=%.4f rejected"
)
CONTRADICTED = "contradicted"
FORM_FILES = {
    "metashape": "camera{}_metashape.xml",
    "colmap": "cameras{}.txt",
    "opencv": "camera{}_opencv.yaml",
}


def write_products(
    solved: AdjustedBlock, figures: dict[str, Any], judgement: Judgement, directory: Path
) -> tuple[Path, ...]:
    """Write every product.

    Parameters
    ----------
    solved : AdjustedBlock
        The block.
    figures : dict
        Its figures; the products are added to them.
    judgement : Judgement
        What is said of it.
    directory : Path
        Where they go.

    Returns
    -------
    tuple of Path
        The files.

    Raises
    ------
    UsageError
        A product would take the place of an input, or cannot be what the block file asks for.
    """
    file = solved.inputs.file
    with together() as staging:
        into = staging.tree(directory)
        if judgement.refused and file.adjustment.write_anyway:
            _write_orientation(solved, figures, judgement, staging.tree(into / CONTRADICTED))
        elif not judgement.refused:
            _write_orientation(solved, figures, judgement, into)
        if file.output.tables:
            write_residuals(solved, into / "residuals.csv")
        start = file.path.absolute().parent
        entries = [entry for entry in into.rglob("*") if entry.is_file()]
        figures |= made_from(input_files(solved), into / ADJUST_DOCUMENT, entries, start)
        names = (entry.relative_to(into).as_posix() for entry in entries)
        figures["products"] = sorted([*names, ADJUST_DOCUMENT, ADJUST_PAGE])
        page = document_of(solved, figures, judgement, charts_of(solved, figures, judgement))
        write_with_page(page, figures, into / ADJUST_DOCUMENT, into / ADJUST_PAGE)
        files = staging.goals()
        refuse_overwriting(files, input_files(solved))
    return files


def _write_orientation(
    solved: AdjustedBlock, figures: dict[str, Any], judgement: Judgement, into: Path
) -> None:
    """Write orientation, exports, cameras and mounting."""
    from ...flight.exporting.export import export
    from ...io.formats import EXPORTS

    file = solved.inputs.file
    eo = adjusted_orientation(solved, judgement)
    if eo is not None:
        names = dict.fromkeys([*file.output.formats, "eo_json"])
        done = {name: export(eo, name, into / EXPORTS[name].product) for name in names}
        figures["exports"] = [
            {"format": name, "file": EXPORTS[name].product, "frame": exported.frame}
            for name, exported in done.items()
        ]
    write_poses(solved, into / POSES_FILE)
    if file.output.tables:
        write_points(solved, into / "points.csv")
    if file.output.pose_covariance:
        images = solved.result.problem.block.images
        keys = [(POSE, k) for k in range(len(images))]
        write_pose_covariance(images, solved.precision.cov(*keys), into / COVARIANCE)
    figures["notes"] += _write_cameras(solved, into)
    if (mounting := adjusted_mounting(solved)) is not None:
        write_mounting_file(mounting, into / MOUNTING_FILE)


def adjusted_orientation(solved: AdjustedBlock, judgement: Judgement) -> ExteriorOrientation | None:
    """Return the orientation of the images that have aerial control, in the order of its stamps.

    Parameters
    ----------
    solved : AdjustedBlock
        The block.
    judgement : Judgement
        What is said of it.

    Returns
    -------
    ExteriorOrientation or None
        Covariances are those of the adjustment, that of neighbours too; None where there is no
        aerial control and so no stamps.
    """
    eo, rows = solved.inputs.eo, solved.inputs.eo_row
    if eo is None:
        return None
    images = np.flatnonzero(rows >= 0)
    images = images[np.argsort(rows[images])]
    oriented_rows, values = rows[images], solved.result.values
    cov = solved.precision.pose_cov[images]
    cross = np.zeros((max(images.size - 1, 0), 6, 6))
    for k in range(images.size - 1):
        pair = ((POSE, int(images[k])), (POSE, int(images[k + 1])))
        cross[k] = solved.precision.cov(*pair)[:6, 6:]
    history = (
        *eo.history,
        f"adjusted with {solved.result.problem.rays.active.sum()} image observations of"
        f" {len(rows)} images: {judgement.headline}",
    )
    boresight = eo.boresight
    if (E := values.blocks.get((BORESIGHT, 0))) is not None:
        boresight = changed_boresight(eo, E)
    return replace(
        eo[oriented_rows],
        position_m=values.position[images],
        C_mc=values.C_mc[images],
        cov=cov,
        cross=cross,
        boresight=boresight,
        history=history,
    )


def changed_boresight(eo: ExteriorOrientation, E: Array) -> Array:
    """Return the bore-sight matrix B of the mounting that the adjustment found.

    With C_o = C_mb (T B)^T observed and C = C_o E, C = C_mb (T B')^T asks for T B' = E^T T B.

    Parameters
    ----------
    eo : ExteriorOrientation
        The aerial control, with B and T that were applied.
    E : ndarray, (3, 3)
        Camera to nominal camera, (J.9) of `insgnss.photogrammetry.adjust.aerial`.

    Returns
    -------
    ndarray, (3, 3)
        B'.
    """
    T = eo.camera_from_body
    return nearest_rotation(T.T @ E.T @ T @ eo.boresight)


def write_poses(solved: AdjustedBlock, path: Path) -> None:
    """Write the pose of every image with standard deviations.

    Parameters
    ----------
    solved : AdjustedBlock
        The block.
    path : path
        The file.
    """
    values, images = solved.result.values, solved.result.problem.block.images
    opk = opk_from_rotation(values.C_mc @ CV_RUB)
    cov = solved.precision.pose_cov
    F = np.linalg.inv(opk_jacobian(opk))
    angles = np.einsum("nij,njk,nik->ni", F, cov[:, 3:, 3:], F)
    sigma = np.sqrt(np.maximum(np.diagonal(cov, axis1=1, axis2=2)[:, :3], 0.0))
    table = np.hstack(
        [values.position, np.degrees(opk), sigma, np.degrees(np.sqrt(np.maximum(angles, 0.0)))]
    )
    POSE_TABLE.write(
        path,
        table,
        quoted_names(images, ","),
        ["yes" if row >= 0 else "no" for row in solved.inputs.eo_row],
        comments=[
            "projection centre, m, and omega phi kappa, deg: Rx(omega) Ry(phi) Rz(kappa) takes the"
            " right-up-back camera to the axes of the block; standard deviations"
        ],
    )


def write_points(solved: AdjustedBlock, path: Path) -> None:
    """Write the object points that take part, with their covariances.

    Parameters
    ----------
    solved : AdjustedBlock
        The block.
    path : path
        The file.
    """
    block, cov = solved.result.problem.block, solved.precision.point_cov
    role = np.full(len(block.points), "tie", dtype=object)
    role[block.control.point], role[block.check.point] = "control", "check"
    rows = np.flatnonzero(np.isfinite(cov).all(axis=(1, 2)))
    numbers = np.column_stack(
        [
            solved.result.values.point,
            np.sqrt(np.maximum(np.diagonal(cov, axis1=1, axis2=2), 0.0)),
            cov[:, [0, 0, 1], [1, 2, 2]],
            solved.result.problem.ray_count,
        ]
    )[rows]
    names = quoted_names([block.points[k] for k in rows], ",", "point")
    POINTS_TABLE.write(
        path, numbers, names, list(role[rows]), comments=["m and m^2, in the axes of poses.csv"]
    )


def write_residuals(solved: AdjustedBlock, path: Path) -> None:
    """Write the residuals of all image observations, observed minus computed.

    Parameters
    ----------
    solved : AdjustedBlock
        The block.
    path : path
        The file.
    """
    block, precision = solved.result.problem.block, solved.precision
    obs = block.observations
    rejected = np.isin(np.arange(len(obs)), solved.rejected)
    e = residuals_px(solved.result)
    numbers = np.column_stack(
        [obs.uv, obs.sigma_px, obs.correlation, e, precision.redundancy, precision.w]
    )
    images = quoted_names(block.images, ",")
    points = quoted_names(block.points, ",", "point")
    RESIDUALS.write(
        path,
        numbers,
        [images[k] for k in obs.image],
        [points[k] for k in obs.point],
        ["yes" if out else "no" for out in rejected],
        comments=["pixels, observed minus computed; nan of observations that take no part"],
    )


def adjusted_cameras(solved: AdjustedBlock) -> tuple[BrownCamera, ...]:
    """Return the cameras with adjusted interior orientation.

    Parameters
    ----------
    solved : AdjustedBlock
        The block.

    Returns
    -------
    tuple of BrownCamera
        The cameras.
    """
    return solved.result.values.cameras(solved.result.problem.block.cameras)


def covariances(solved: AdjustedBlock) -> list[InteriorCovariance | None]:
    """Return the covariance of each camera's interior orientation.

    Parameters
    ----------
    solved : AdjustedBlock
        The block.

    Returns
    -------
    list
        One a camera; None where nothing of it was estimated.
    """
    out: list[InteriorCovariance | None] = []
    columns = solved.result.problem.layout.columns
    for c, camera in enumerate(solved.result.problem.block.cameras):
        estimated = [k for k, row in enumerate(columns) if INTERIOR[row] in camera.free]
        P = solved.precision.cov((CAMERA, c))[np.ix_(estimated, estimated)] if estimated else None
        names = tuple(INTERIOR[columns[k]] for k in estimated)
        out.append(None if P is None else InteriorCovariance(names, P))
    return out


def _write_cameras(solved: AdjustedBlock, into: Path) -> list[str]:
    """Write the cameras in each format; returns what a format cannot express."""
    cameras, P_of = adjusted_cameras(solved), covariances(solved)
    notes: list[str] = []
    for form in solved.inputs.file.output.cameras:
        for k, (camera, P) in enumerate(zip(cameras, P_of, strict=True)):
            number = f"_{k + 1}" if len(cameras) > 1 else ""
            if form == "toml":
                write_camera_toml(camera, into / f"camera{number}.toml", P)
                continue
            try:
                path = into / FORM_FILES[form].format(number)
                notes += write_cameras([camera], path, form, [P])
            except InputError as refusal:
                notes.append(str(refusal))
    return notes


def adjusted_mounting(solved: AdjustedBlock) -> MountingFile | None:
    """Return the mounting that the adjustment found.

    Lever arms and delay are corrections of what the flight was processed with, which report.json
    beside its eo.json says.

    Parameters
    ----------
    solved : AdjustedBlock
        The block.

    Returns
    -------
    MountingFile or None
        None where no parameter of the mounting was estimated.
    """
    eo, blocks = solved.inputs.eo, solved.result.values.blocks
    estimated = [
        name for name in (BORESIGHT, CAMERA_LEVER_ARM, EXPOSURE_DELAY) if (name, 0) in blocks
    ]
    if eo is None or not estimated or solved.inputs.file.aerial_control.positions_alone:
        return None
    before = processed_with(solved.inputs)
    cov = {name: solved.precision.cov((name, 0)) for name in estimated}
    values: dict[str, Any] = {}
    remarks = [f"from {eo.images[0]} to {eo.images[-1]}"]
    if BORESIGHT in estimated:
        values["boresight"] = changed_boresight(eo, blocks[(BORESIGHT, 0)])
        values["boresight_cov"] = cov[BORESIGHT]
    if CAMERA_LEVER_ARM in estimated:
        change, E = blocks[(CAMERA_LEVER_ARM, 0)], blocks.get((BORESIGHT, 0), np.eye(3))
        for key in ("antenna_m", "imu_m"):
            if before is not None:  # the body's lever arms in the axes of the adjusted camera
                values[key] = E.T @ np.array(before["mounting"][key]) + change
                values[f"{key.removesuffix('_m')}_cov"] = cov[CAMERA_LEVER_ARM]
            else:
                change_text = " ".join(f"{x:+.5f}" for x in change)
                remarks.append(f"{key}: add {change_text} m (no report.json beside eo.json)")
    if EXPOSURE_DELAY in estimated:
        delay, sigma = (
            float(blocks[(EXPOSURE_DELAY, 0)][0]),
            float(np.sqrt(cov[EXPOSURE_DELAY][0, 0])),
        )
        if before is not None and before.get("camera"):
            values["time_offset_s"] = before["camera"]["time_offset_s"] + delay
            values["time_offset_sigma_s"] = sigma
        else:
            remarks.append(f"camera.time_offset_s: add {delay:+.7f} ({sigma:.6f} s)")
    week = eo.gps_week
    cameras = adjusted_cameras(solved)
    of_one = {} if len(cameras) > 1 else _identity(cameras[0])
    file = solved.inputs.file
    inputs = (file.path, file.images.file, file.camera.file, file.aerial_control.file)
    files = dict.fromkeys(p for p in (*inputs, file.ground.file) if p is not None and p.is_file())
    return MountingFile(
        verb="adjust",
        **values,
        **of_one,
        camera_from_body=eo.camera_from_body,
        date="" if week is None else calendar_from_gps(week, float(eo.time[0])).date().isoformat(),
        inputs=tuple((path.name, sha256(path)) for path in files),
        remarks=tuple(remarks),
    )


def _identity(camera: BrownCamera) -> dict[str, Any]:
    """Name, image size and focal length of a camera, as far as they are known."""
    return {
        "camera": camera.name,
        "image_size": (camera.width, camera.height),
        "focal_px": camera.of("f"),
    }
