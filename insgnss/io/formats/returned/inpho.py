"""Cameras and photographs of a project of Inpho, data_specs/camera_files.md and returned.md.

A camera's CCD_INTERIOR_ORIENTATION takes photograph coordinates (mm, x right, y up) to pixels from
the centre of the first one. A sensor may be built in turned: with A its 2 x 2 part, U upper
triangular with a positive diagonal and Q a rotation with y reversed,

    A = U Q                                                                              (I.1)

U takes the axes of the pixels to pixels, and Q the photograph's axes to those of the pixels.
$EXT_ORI of a photograph has the focal length, X Y Z and the matrix of the frame to the photograph's
axes. The file does not say in which direction its distortion goes:

    x + x (K0 + K1 r^2 + ...) + P1 (r^2 + 2 x^2) + 2 P2 x y                              (I.2)

is the image point of the ideal point x, forward, or the other way round, backward; nor does it say
whether P1 is that of x, as here, or P2. The CRS stands there as well-known text.
"""

import re
from collections.abc import Mapping

import numpy as np

from ....base.errors import InputError, near
from ....base.files import lines_of
from ....geodesy.rotation import CV_RUB
from ....records.block import RADIAL_MODELS, Array, BrownCamera
from ..text.layout import quote
from ..text.numbers import finite, whole
from ..text.text import Source, decode_text
from .crs import kind_of_wkt
from .poses import ReturnedPoses, checked_rotations, image_names, numbers

INPHO_LINES = 4  # of $EXT_ORI: focal length and position, three rows of the matrix
RADIAL_TERMS = 5  # of RADIAL_COEFFS that a camera has a place for: K0 to K4
DECENTRING_TERMS = 2  # of DECENTRE_COEFFS that have a place: P1 and P2
EXCHANGED = "-p2x"  # behind a direction: P2 is that of x
FIELD = re.compile(r"\$(\w+)\s*:([^$]*)")  # of a camera: its name and its values
INPHO_CRS = re.compile(r"\$COORDINATE_SYSTEM\s*:\s*([^$]+)")  # well-known text, or a name
SAME_TURN = 0.1  # of elements of two cameras' rotations: sensors are turned by quarters (chosen)
# first pixel's centre from its outer corner (px): Inpho counts from the centre
FROM_CENTRE_PX = 0.5


def read_inpho_cameras(path: Source, direction: str | None = None) -> tuple[BrownCamera, ...]:
    """Read the cameras of a project of Inpho.

    Parameters
    ----------
    path : path
        The .prj.
    direction : str, optional
        "forward" or "backward", of a distortion, perhaps with `EXCHANGED` behind.

    Returns
    -------
    tuple of BrownCamera
        In the order of the file.

    Raises
    ------
    InputError
        A camera that is not complete, a distortion that the model does not hold, or one of which
        nobody says the direction.
    """
    return tuple(
        _camera(name, fields, path, direction) for name, fields in _definitions(path).items()
    )


def _definitions(path: Source) -> dict[str, dict[str, str]]:
    """Return the fields of each camera that the project defines, by its name."""
    cameras: dict[str, dict[str, str]] = {}
    opening = r"(?ms)^([ \t]*)\$CAMERA(?:_DEFINITION)?[ \t]*$"
    for _, body in re.findall(opening + r"(.*?)^\1\$END[ \t]*$", decode_text(path)):
        fields: dict[str, str] = dict(FIELD.findall(body))
        # of a calibration set the $ID stands behind that of its camera
        type_or_id = re.search(r"\$(?:TYPE|ID)[ \t]*:[ \t]*(\S.*)", body)
        name = type_or_id[1].strip() if type_or_id else f"camera {len(cameras) + 1}"
        common_text, *calibration_sets = body.split("$CALIBRATION_SET")
        if len(calibration_sets) > 1:
            active = re.search(r"\$ACTIVE_CALIBRATION[ \t]*:[ \t]*(\S+)", common_text)
            number = r"\$ID[ \t]*:[ \t]*" + re.escape(active[1] if active else "") + r"[ \t]*$"
            chosen = [text for text in calibration_sets if re.search(number, text, re.MULTILINE)]
            if len(chosen) != 1:
                problem = (
                    f"camera {quote(name)}: {len(calibration_sets)} calibration sets, of which"
                )
                problem += f" {len(chosen)} have the number of $ACTIVE_CALIBRATION"
                raise InputError.in_file(path, f"{problem}; keep the active one alone")
            fields = dict(FIELD.findall(common_text + chosen[0]))
        cameras[name] = fields
    return cameras


def _values(fields: Mapping[str, str], key: str, path: Source, count: int) -> Array:
    """Return `count` or more numbers of a field; none at all only of a `count` of zero."""
    text = fields.get(key, "")
    values = np.array([finite(word) for word in text.split()])
    if values.size < count or not np.isfinite(values).all():
        raise InputError.in_file(
            path, f"${key} {quote(text.strip())}: {count} numbers are expected; export it again"
        )
    return values


def _axes(fields: Mapping[str, str], path: Source) -> tuple[Array, Array]:
    """Return U (2, 2) of (I.1), px/mm, and the rotation (3, 3) of the photograph to the camera."""
    A = _values(fields, "CCD_INTERIOR_ORIENTATION", path, 6)[:6].reshape(2, 3)[:, :2]
    if not np.linalg.det(A) < 0.0:
        problem = "$CCD_INTERIOR_ORIENTATION mirrors the image; export it again"
        raise InputError.in_file(path, problem)
    down = A[1] / np.linalg.norm(A[1])
    rotation = np.diag([0.0, 0.0, -1.0])
    rotation[:2, :2] = [-down[1], down[0]], down
    return A @ rotation[:2, :2].T, rotation


def _camera(
    name: str, fields: Mapping[str, str], path: Source, direction: str | None
) -> BrownCamera:
    """Return a camera; InputError where its distortion is not held."""
    pixels_of_mm, rotation = _axes(fields, path)
    focal = float(_values(fields, "FOCAL_LENGTH", path, 1)[0])
    ppa = _values({"PRINCIPAL_POINT_PPA": "0 0", **fields}, "PRINCIPAL_POINT_PPA", path, 2)[:2]
    centre_px = _values(fields, "CCD_INTERIOR_ORIENTATION", path, 6)[2:6:3]
    cx, cy = pixels_of_mm @ rotation[:2, :2] @ ppa + centre_px + FROM_CENTRE_PX
    width, height = (whole(fields.get(key, "").strip()) for key in ("CCD_COLUMNS", "CCD_ROWS"))
    radial, decentring = (
        _values(fields, key, path, 0) for key in ("RADIAL_COEFFS", "DECENTRE_COEFFS")
    )
    if any(radial[RADIAL_TERMS:]) or any(decentring[DECENTRING_TERMS:]):
        problem = f"distortion terms beyond K{RADIAL_TERMS - 1} and P{DECENTRING_TERMS}"
        problem = f"camera {quote(name)}: {problem} have no place here; calibrate it without them"
        raise InputError.in_file(path, problem)
    radial = np.pad(radial[:RADIAL_TERMS], (0, max(0, RADIAL_TERMS - radial.size)))
    decentring = np.pad(
        decentring[:DECENTRING_TERMS], (0, max(0, DECENTRING_TERMS - decentring.size))
    )
    if direction is None and (radial.any() or decentring.any()):
        corner = 0.5 * np.hypot(width, height) / pixels_of_mm[1, 1]
        raise InputError.in_file(
            path, _undecided_parameters(name, radial, decentring, corner, float(pixels_of_mm[1, 1]))
        )
    order = slice(None, None, -1 if (direction or "").endswith(EXCHANGED) else 1)
    scale, p = 1.0 + radial[0], rotation[:2, :2] @ decentring[order]
    f, k = pixels_of_mm[1, 1] * focal, radial[1:]
    if (direction or "").startswith(RADIAL_MODELS[1]):
        values = [
            f / scale,
            cx,
            cy,
            pixels_of_mm[1, 1] / pixels_of_mm[0, 0] - 1.0,
            -pixels_of_mm[0, 1] / pixels_of_mm[0, 0],
        ]
        interior = np.array([*values, *(k / scale), *(p / scale)])
        return BrownCamera(
            name, width, height, interior, backward=True, unit_px=float(pixels_of_mm[1, 1])
        )
    # of lengths in the focal length
    k, p = k * focal ** (2.0 * np.arange(1, RADIAL_TERMS)) / scale, p * focal / scale
    f, focal_x, skew = (
        scale * f,
        scale * focal * pixels_of_mm[0, 0],
        scale * focal * pixels_of_mm[0, 1],
    )
    return BrownCamera(name, width, height, np.array([f, cx, cy, focal_x - f, skew, *k, *p]))


def _undecided_parameters(name: str, K: Array, P: Array, corner: float, px: float) -> str:
    """Return what the file of a camera does not say, with its size at a corner (mm; px/mm)."""
    largest = px * abs(corner * (K @ corner ** (2.0 * np.arange(RADIAL_TERMS))))
    problem = (
        f"camera {quote(name)}: does not say the direction of its distortion"
        f" ({largest:.3g} px at the corners)"
    )
    if P.any():  # orders differ by (P1 - P2) (r^2 + 2 x^2 - 2 x y), at most r^2 (2 + sqrt 2) of it
        exchanged = (2.0 + 2.0**0.5) * px * corner**2 * abs(float(P[0] - P[1]))
        problem += f" nor whether P1 or P2 is that of x (up to {exchanged:.2g} px; add {EXCHANGED}"
        problem += " for P2)"
    return (
        f"{problem}; write it as camera.toml by insgnss camera --distortion forward (image from"
        " ideal points) or backward, --as toml: the right one leaves the smaller residuals in"
        " insgnss adjust"
    )


def read_inpho_prj(path: Source) -> ReturnedPoses:
    """Read the photo blocks of a project of Inpho.

    Parameters
    ----------
    path : path
        The .prj.

    Returns
    -------
    ReturnedPoses
        In the CRS of $COORDINATE_SYSTEM, else in a frame that is not named, of a camera whose axes
        are those of its pixels; photographs without $EXT_ORI are left out, with a note.

    Raises
    ------
    InputError
        A block that is not complete, a matrix that is no rotation, or a camera that is not
        defined, with file and line.
    """
    lines = lines_of(decode_text(path))
    names, rows, matrices, turned, left_out = [], [], [], [], 0
    sensors = {name: _axes(fields, path)[1] for name, fields in _definitions(path).items()}
    photo: dict[str, tuple[int, str]] | None = None
    for line, text in enumerate(lines, start=1):
        key, colon, value = text.partition(":")
        key = key.strip().upper()
        if key == "$PHOTO" and not colon:
            photo = {}
        elif photo is not None and colon and key.startswith("$"):
            photo[key] = (line, value.strip())
        elif photo is not None and key == "$END":
            if "$EXT_ORI" not in photo:
                left_out += 1
            else:
                start = photo["$EXT_ORI"][0]
                values = [
                    numbers(lines[k].split(), path, k + 1)
                    for k in range(start, min(start + INPHO_LINES, line - 1))
                ]
                if [len(v) for v in values] != [4, 3, 3, 3]:
                    raise InputError.at_line(
                        path,
                        start,
                        "$EXT_ORI must hold the focal length, X, Y, Z and a 3 x 3 matrix",
                    )
                file = photo.get("$PHOTO_FILE", photo.get("$PHOTO_NUM", (start, "")))[1]
                names.append(file)
                rows.append(values[0][1:])
                matrices.append(values[1:])
                turned.append(_axes_rotation(sensors, photo.get("$CAMERA_ID", (start, "")), path))
            photo = None
    images = image_names(names, path)
    R = checked_rotations(np.reshape(matrices, (-1, 3, 3)), images, path)
    notes = (f"{left_out} photographs without orientation are left out",) if left_out else ()
    C = R.swapaxes(1, 2) @ np.array(turned).swapaxes(1, 2)
    systems = {" ".join(text.split()) for text in INPHO_CRS.findall(decode_text(path))}
    wkt = systems.pop() if len(systems) == 1 else ""
    kind, crs = kind_of_wkt(wkt, path) if "[" in wkt else ("", "")
    return ReturnedPoses(images, np.array(rows), C, kind, crs, notes=notes)


def _axes_rotation(sensors: Mapping[str, Array], named: tuple[int, str], path: Source) -> Array:
    """Return the rotation (3, 3) of a photograph's axes (right, up, back) to those of its camera.

    Without a definition of any camera the pixels are taken to lie along them.
    """
    line, name = named
    rotation = sensors.get(name)
    if rotation is None:
        rotation = next(iter(sensors.values()), CV_RUB)
        if any(np.abs(R - rotation).max() > SAME_TURN for R in sensors.values()):
            nearest = near(name, sensors)
            raise InputError.at_line(path, line, f"camera {quote(name)} is not defined; {nearest}")
    return rotation
