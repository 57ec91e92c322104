"""Adjusted poses in the files of whole projects, data_specs/returned.md.

bentley        BlocksExchange XML: Pose of each Photo, in the reference system of its block; the
               one under Metadata is what was imported, and is taken where there is no other
micmac_xml     Orientation-<image>.xml, or Ori-PerspCentral-<image>.xml of its second version
metashape_xml  camera XML, .psx or .psz of Metashape: `blocks.metashape_block`
colmap         images.txt, or a model that pycolmap reads
opensfm        reconstruction.json, with reference_lla
"""

from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from ....base.errors import InputError
from ....base.files import lines_of
from ....geodesy.rotation import rotation_from_opk, rotation_from_quaternion
from ....records.framed import GEOCENTRIC, GEOGRAPHIC, TANGENT
from ..blocks.colmap_model import read_colmap_poses
from ..blocks.metashape_chunk import chunk_poses, on_globe, opened_chunk
from ..blocks.opensfm_model import read_opensfm_poses
from ..bundle.micmac import read_micmac_xml
from ..text.layout import quote
from ..text.numbers import PLAIN, finite
from ..text.text import Source, check_fields, decode_text
from ..text.xml import read_xml, text_of
from .crs import kind_of_definition, of_other_ellipsoid
from .poses import UNPOSED, Array, ReturnedPoses, checked_rotations, image_names, numbers

POSE_FIELDS = 10  # of a line of COLMAP's images.txt: id, qw qx qy qz, tx ty tz, camera, name
BENTLEY_DIRECTIONS = {
    "RIGHT": (1.0, 0.0, 0.0),
    "LEFT": (-1.0, 0.0, 0.0),
    "DOWN": (0.0, 1.0, 0.0),
    "UP": (0.0, -1.0, 0.0),
}


def read_bentley(path: Source) -> ReturnedPoses:
    """Read a block of ContextCapture or iTwin Capture.

    Parameters
    ----------
    path : path
        BlocksExchange XML.

    Returns
    -------
    ReturnedPoses
        In the reference system of the block; photographs without pose are left out, with a note.

    Raises
    ------
    InputError
        Damaged XML, a pose without rotation or centre, or several reference systems.
    """
    root = read_xml(path)
    systems = {text_of(srs.find("Id")): text_of(srs.find("Definition")) for srs in root.iter("SRS")}
    names, centre, C, used, left_out, imported = [], [], [], [], 0, 0
    for block in root.iter("Block"):
        of_block = text_of(block.find("SRSId"))
        for group in block.iter("Photogroup"):
            of_group = text_of(group.find("SRSId")) or of_block
            Q = _camera_axes(group.findtext("CameraOrientation", "XRightYDown").strip(), path)
            for photo in group.iter("Photo"):
                name = text_of(photo.find("ImagePath"))
                pose, system = _pose(photo, of_group)
                if pose is None:
                    left_out += 1
                    continue
                imported += pose.tag == "Metadata"
                centre.append([_number(pose, f"Center/{axis}", name, path) for axis in "xyz"])
                C.append(_rotation(pose, name, path).T @ Q)
                names.append(name)
                if system and system not in systems:
                    problem = (
                        f"photograph {quote(name)}: SRSId {quote(system)} is not among the <SRS> of"
                        " this file"
                    )
                    raise InputError.in_file(path, f"{problem}; export again")
                used.append(systems.get(system, ""))
    if len(set(used)) > 1:
        raise InputError.in_file(
            path, f"its poses stand in {len(set(used))} reference systems; export one block"
        )
    images = image_names(names, path)
    kind, crs, origin = kind_of_definition(used[0], path)
    position = np.array(centre)
    if kind == GEOGRAPHIC:
        position[:, :2] = np.radians(position[:, :2])
    notes = (f"{left_out} photographs without pose are left out",) if left_out else ()
    if imported:
        notes = (
            f"{imported} poses are the imported ones, since the file has no adjusted pose of these"
            " images",
            *notes,
        )
    rotations = checked_rotations(np.array(C), images, path)
    origin = (*np.radians(origin[:2]).tolist(), *origin[2:])
    return ReturnedPoses(images, position, rotations, kind, crs, origin, notes=notes)


def _pose(photo: Element, system: str) -> tuple[Element | None, str]:
    """Return the adjusted pose of a photograph, else the imported one, and its reference system."""
    pose = photo.find("Pose")
    if pose is None or pose.find("Center") is not None:
        return pose, system
    metadata = pose.find("Metadata")
    if metadata is None or metadata.find("Center") is None:
        return None, system
    return metadata, text_of(metadata.find("SRSId")) or system


def _number(element: Element, tag: str, name: str, path: Source) -> float:
    """Return a finite number of an element."""
    value = finite(text := element.findtext(tag))
    if np.isnan(value):
        problem = f"photograph {quote(name)}: {tag} {quote(text)} is no number"
        raise InputError.in_file(path, f"{problem}; {PLAIN}, or export again")
    return value


def _rotation(pose: Element, name: str, path: Source) -> Array:
    """Return the matrix (3, 3) of the frame to the camera, from itself or from its angles."""
    rotation = pose.find("Rotation")
    if rotation is None:
        raise InputError.in_file(
            path,
            f"photograph {quote(name)} has no rotation; export the project after its adjustment",
        )
    if rotation.find("M_00") is not None:
        return np.array(
            [[_number(rotation, f"M_{i}{j}", name, path) for j in range(3)] for i in range(3)]
        )
    if rotation.find("Omega") is None:
        angles = ", ".join(angle.tag for angle in rotation)
        problem = f"photograph {quote(name)}: its rotation has {angles}"
        raise InputError.in_file(path, f"{problem}; export matrices or omega, phi, kappa")
    degrees = [_number(rotation, angle, name, path) for angle in ("Omega", "Phi", "Kappa")]
    return rotation_from_opk(np.radians([degrees]))[0].T


def _camera_axes(text: str, path: Source) -> Array:
    """Return the rotation (3, 3) of camera axes right, down, viewing direction into the named."""
    to_x, _, to_y = text.upper().removeprefix("X").partition("Y")
    x, y = (np.array(BENTLEY_DIRECTIONS.get(word, (0.0, 0.0, 0.0))) for word in (to_x, to_y))
    z = np.cross(x, y)
    if not z.any():
        raise InputError.in_file(path, f"CameraOrientation {quote(text)} is unknown")
    return np.array([x, y, z])


def read_micmac(path: Source) -> ReturnedPoses:
    """Read the orientations of a directory of MicMac.

    Parameters
    ----------
    path : path
        Such as Ori-Compensated.

    Returns
    -------
    ReturnedPoses
        In a frame that is not named here.

    Raises
    ------
    InputError
        As `read_micmac_xml`.
    """
    images, position, C = read_micmac_xml(path)
    return ReturnedPoses(images, position, C)


def read_metashape_xml(path: Source) -> ReturnedPoses:
    """Read the cameras of a project of Metashape, or of its exported XML.

    Parameters
    ----------
    path : path
        As of `read_metashape_block`; its tie points are not needed.

    Returns
    -------
    ReturnedPoses
        Geocentric, or in the CRS of the chunk where that is of another ellipsoid; in axes of the
        chunk where it has no CRS. With the covariances of the file
        where all images have them.

    Raises
    ------
    InputError
        As `read_metashape_block`, or no image has a pose.
    """
    notes: list[str] = []
    of = opened_chunk(path)
    images, _ = of.images(notes)
    poses = chunk_poses(of, images, notes)
    rows = np.flatnonzero(np.isfinite(poses.position[:, 0]))
    if not rows.size:
        raise InputError.in_file(path, UNPOSED)
    names = of.names([images[k] for k in rows])
    position, C = poses.position[rows], poses.C_mc[rows]
    covs = [P[rows] for P in (poses.cov_position, poses.cov_attitude)]
    kind, crs = GEOCENTRIC if on_globe(of, poses.local) else "", ""
    if kind and (on_ellipsoid := of_other_ellipsoid(of.crs(), position, path)) is not None:
        kind, crs, position, R = on_ellipsoid
        C, covs = R @ C, [R @ P @ R.swapaxes(1, 2) for P in covs]
    return ReturnedPoses(
        names,
        position,
        C,
        kind,
        crs,
        notes=tuple(notes),
        cov_position=covs[0] if np.isfinite(covs[0]).all() else None,
        cov_attitude=covs[1] if np.isfinite(covs[1]).all() else None,
    )


def read_colmap(path: Source) -> ReturnedPoses:
    """Read the poses of a COLMAP model; from text without pycolmap.

    Parameters
    ----------
    path : path
        images.txt, or a directory with a model.

    Returns
    -------
    ReturnedPoses
        In the axes of the model; a shift that an export of ours subtracted is added again where
        its comment is still there.

    Raises
    ------
    InputError
        A line that is none of images.txt, with file and line, or what pycolmap does not read.
    UsageError
        A binary model without pycolmap.
    """
    location = Path(path)
    file = location / "images.txt" if location.is_dir() else location
    if file.name != "images.txt" or not file.is_file():
        names, position, C = read_colmap_poses(path)
        return ReturnedPoses(image_names(names, path), position, C)
    shift = np.zeros(3)
    named: list[str] = []
    rows: list[list[float]] = []
    poses_next = True
    for line, text in enumerate(lines_of(decode_text(file)), start=1):
        if text.startswith("#"):
            fields = text.split()
            if fields[1:2] == ["shift:"]:
                shift = np.array(numbers(fields[2:5], file, line))
                if shift.size != 3:
                    problem = f"{quote(text)}: a shift is three numbers; copy the file again"
                    raise InputError.at_line(file, line, problem)
            continue
        if poses_next:
            fields = text.split(maxsplit=POSE_FIELDS - 1)
            if not fields:
                continue
            check_fields(file, line, fields, POSE_FIELDS, text)
            named.append(fields[9].strip())
            rows.append(numbers(fields[1:8], file, line))
        poses_next = not poses_next
    table = np.reshape(rows, (-1, 7))
    images = image_names(named, file)
    C = rotation_from_quaternion(table[:, :4]).swapaxes(1, 2)
    position = shift - (C @ table[:, 4:, None])[:, :, 0]
    return ReturnedPoses(images, position, C)


def read_opensfm(path: Source) -> ReturnedPoses:
    """Read the shots of a reconstruction of OpenSfM or OpenDroneMap.

    Parameters
    ----------
    path : path
        reconstruction.json, or the directory of the project.

    Returns
    -------
    ReturnedPoses
        In the tangent plane of `reference_lla`; in axes of its own without it.

    Raises
    ------
    InputError
        As `read_opensfm_model`.
    """
    names, position, C, plane, notes = read_opensfm_poses(path)
    origin = () if plane is None else (plane.lat, plane.lon, plane.height)
    kind = TANGENT if origin else ""
    return ReturnedPoses(image_names(names, path), position, C, kind, origin=origin, notes=notes)
