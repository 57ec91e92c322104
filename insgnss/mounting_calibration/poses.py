"""Poses of an adjustment of any program, as `BlockPoses` in the tangent plane or a frame of theirs.

    eo.json, tables with a header, exports of insgnss     read by `comparison.reading`
    Metashape, COLMAP, OpenSfM                            read by `formats.blocks.reading`
    MicMac Ori-*, poses.csv of insgnss adjust             readers of their own

A block whose axes the file ties to the Earth, or which stands in the tangent plane of the flight, is
georeferenced; any other is tied by a similarity.
"""

from pathlib import Path

import numpy as np

from ..base.errors import InputError, InsgnssError
from ..base.files import first_bytes
from ..comparison.hints import HEAD, Hints
from ..comparison.poses import NoOriginError, Poses
from ..comparison.reading import read_poses
from ..formats.blocks.joined import matched
from ..formats.blocks.reading import read_measured_block
from ..formats.bundle.micmac import read_micmac_xml
from ..formats.orientation.adjusted_poses import is_adjusted_poses, read_adjusted_poses
from ..geodesy.frames import TangentPlane, rotation_em
from ..geodesy.projection import MapProjection
from ..geodesy.rotation import NED_ENU
from ..records import ExteriorOrientation
from ..records.block import Array
from .records import BlockPoses, Rows

PROGRAMS = (".xml", ".psx", ".psz")


def read_block_poses(
    path: Path, eo: ExteriorOrientation, crs: str | None = None, form: str | None = None
) -> BlockPoses:
    """Read the poses of an adjusted block.

    Parameters
    ----------
    path : Path
        File or directory.
    eo : ExteriorOrientation
        Whose tangent plane has the axes of what is georeferenced.
    crs : str, optional
        CRS of the coordinates, where the file does not name it.
    form : str, optional
        Format of a table that does not show it.

    Returns
    -------
    BlockPoses
        All images with a pose.

    Raises
    ------
    InputError
        With file and line.
    """
    if not path.exists():
        raise InputError.at_line(path, None, "does not exist; give poses of an adjusted block")
    plane = TangentPlane(*(float(x) for x in eo.origin))
    if path.is_dir() and any(path.glob("Orientation-*.xml")):
        images, X, C = read_micmac_xml(path)
        if np.linalg.norm(X.mean(axis=0)) > GEOCENTRIC_M:
            X, C = _from_ecef(X, C, plane)
            return BlockPoses(images, X, C, None, True, str(path))
        return BlockPoses(images, X, C, None, _near(X, eo), str(path))
    if path.is_dir() or path.suffix.lower() in PROGRAMS or path.name == "reconstruction.json":
        return _of_program(path, eo, plane, crs)
    if form is None and is_adjusted_poses(first_bytes(path, HEAD).decode("latin-1")):
        table = read_adjusted_poses(path)
        near = _near(table.position_m, eo)
        return BlockPoses(table.images, table.position_m, table.C_mc, table.cov, near, str(path))
    origin = (float(np.degrees(plane.lat)), float(np.degrees(plane.lon)), float(plane.height))
    hints = Hints(crs=crs, gps_week=eo.gps_week, datum=eo.datum, epoch=eo.epoch)
    try:
        return _of_poses(read_poses(path, form, hints), plane)
    except NoOriginError:
        hints = Hints(origin, crs, eo.gps_week, datum=eo.datum, epoch=eo.epoch)
        block = _of_poses(read_poses(path, form, hints), plane)
        note = f"{path.name} names no origin; that of the flight's tangent plane is taken"
        return BlockPoses(
            block.images, block.position, block.C_rc, block.cov, True, str(path), (note,)
        )


GEOCENTRIC_M = 6.0e6
NEAR_M = 2.0e3  # of the mean position from the flight's: coordinates of its tangent plane


def _near(X: Array, eo: ExteriorOrientation) -> bool:
    """Whether coordinates look like those of the flight's tangent plane."""
    apart = X.mean(axis=0) - eo.position_m.mean(axis=0)
    size, own = (float(np.linalg.norm(np.std(x, axis=0))) for x in (X, eo.position_m))
    return bool(np.linalg.norm(apart) < NEAR_M and 0.5 < size / max(own, 1e-9) < 2.0)


def _of_program(
    path: Path, eo: ExteriorOrientation, plane: TangentPlane, crs: str | None
) -> BlockPoses:
    measured = read_measured_block(path)
    good = np.isfinite(measured.position_m).all(axis=1)
    if not good.any():
        raise InputError.at_line(path, None, "no image has a pose; align and adjust the block")
    images = tuple(np.array(measured.measured.images, dtype=object)[good].tolist())
    X, C = measured.position_m[good], measured.C_mc[good]
    notes = tuple(measured.notes)
    if measured.geocentric:
        X, C = _from_ecef(X, C, plane)
        return BlockPoses(images, X, C, None, True, str(path), notes)
    named = crs or measured.crs
    if not measured.local and named is not None:
        try:
            lat, lon, h = MapProjection(named, None, eo.datum, eo.epoch).inverse(X)
            axes = MapProjection(named, None, eo.datum, eo.epoch).axes(lat, lon, h)
        except InsgnssError as error:
            raise InputError.at_line(path, None, f"CRS {named}: {error}") from None
        X_m = plane.position_from_geodetic(lat, lon, h)
        C_mE = plane.C_mn(lat, lon) @ NED_ENU
        return BlockPoses(
            images, X_m, C_mE @ axes.swapaxes(1, 2) @ C, None, True, str(path), notes
        )
    return BlockPoses(images, X, C, None, not measured.local and _near(X, eo), str(path), notes)


def _from_ecef(X: Array, C: Array, plane: TangentPlane) -> tuple[Array, Array]:
    """Take geocentric poses to the tangent plane, rigidly."""
    from ..geodesy.frames import ecef_to_geodetic

    lat, lon, h = ecef_to_geodetic(X)
    C_em = rotation_em(np.array([plane.lat]), np.array([plane.lon]))[0]
    return plane.position_from_geodetic(lat, lon, h), C_em.T @ C


def _of_poses(poses: Poses, plane: TangentPlane) -> BlockPoses:
    """Take poses of the comparison to the tangent plane."""
    if poses.C_Ex is None or not poses.images:
        raise InputError.at_line(
            poses.source, None, "has no attitudes of named images; give poses of an adjusted block"
        )
    if poses.x != "camera":
        raise InputError.at_line(
            poses.source, None, "has attitudes of the body; give those of the camera"
        )
    X = plane.position_from_geodetic(poses.lat, poses.lon, poses.height)
    C_mE = plane.C_mn(poses.lat, poses.lon) @ NED_ENU
    cov = None
    if poses.cov_position is not None and poses.cov_attitude is not None:
        cov = np.zeros((poses.n, 6, 6))
        for where, part in ((slice(0, 3), poses.cov_position), (slice(3, 6), poses.cov_attitude)):
            cov[:, where, where] = C_mE @ part @ C_mE.swapaxes(1, 2)
    return BlockPoses(
        poses.images, X, C_mE @ poses.C_Ex, cov, True, poses.source, tuple(poses.notes)
    )


def common_images(block: BlockPoses, eo: ExteriorOrientation) -> tuple[BlockPoses, Rows]:
    """Return the images that both know.

    Parameters
    ----------
    block : BlockPoses
        The block.
    eo : ExteriorOrientation
        The flight.

    Returns
    -------
    block : BlockPoses
        These images, in the order of the flight.
    rows : ndarray
        Their rows in the flight's orientation, increasing.

    Raises
    ------
    InputError
        None is common.
    """
    row = matched(block.images, eo.images)
    own = np.flatnonzero(row >= 0)
    if not own.size:
        raise InputError(
            f"{block.source}: none of its {len(block.images)} images ({block.images[0]}, ...) is of"
            f" this flight ({eo.images[0]}, ...); names are compared without directory, ending and"
            " case"
        )
    own = own[np.argsort(row[own])]
    return block.taken(own), row[own]
