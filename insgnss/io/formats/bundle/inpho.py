"""Trimble Inpho: photo blocks of a project (.prj), and its GNSS/INS table, data_specs/inpho.md.

    prj     $EXT_ORI with focal length (mm), X Y Z and, row by row, (Rx(omega) Ry(phi) Rz(kappa))^T:
            the frame to the camera with axes right, up, back
    ascii   id E N H omega phi kappa time, blank separated, for the importer that assigns columns

The identifier of a photo is its file name without the ending. Standard deviations have no place in
either. Times are GPS time.
"""

from collections.abc import Iterable, Sequence
from pathlib import PurePath

import numpy as np

from ....base.errors import InputError, UsageError
from ....base.files import atomic_write
from ....geodesy.gpstime import WEEK_S
from ....records import FramedOrientation
from ..orientation.ascii_columns import ROTATION_SENSES, Conventions, numbers_of, write_columns
from ..orientation.exported import check_names, comment_lines
from ..text.text import Source

GPS_EPOCH_MS = np.datetime64("1980-01-06T00:00:00", "ms")
PHOTO = """$PHOTO
  $PHOTO_NUM : %s
  $PHOTO_FILE : %s
  $CAMERA_ID : {camera}
  $TERRAIN_HEIGHT : {ground:.3f}
  $IO_STAT : manual
  $ORI_STAT : initial
  $EXT_ORI : %s
    {focal:.6f} %.4f %.4f %.4f
    %.12f %.12f %.12f
    %.12f %.12f %.12f
    %.12f %.12f %.12f
$END
"""


def write_inpho_prj(
    eo: FramedOrientation,
    path: Source,
    focal_mm: float | None = None,
    ground_m: float | None = None,
    camera: str = "camera",
) -> None:
    """Write $PHOTO blocks of a projected or tangent-plane frame.

    They are to be put into a project that defines `camera`. Metres have 4 decimals, matrices 12.

    Parameters
    ----------
    eo : FramedOrientation
        The orientation in its frame.
    path : path
        The file.
    focal_mm : float
        Focal length, mm.
    ground_m : float
        Height of the terrain in the frame's heights, m; the file has it in the unit of the CRS.
    camera : str
        Name of the camera in the project.

    Raises
    ------
    UsageError
        `focal_mm` or `ground_m` missing.
    InputError
        File names that agree but for their ending.
    """
    if (
        focal_mm is None
        or ground_m is None
        or not 0.0 < focal_mm < np.inf
        or not abs(ground_m) < np.inf
    ):
        problem = (
            f"needs focal_mm (got {focal_mm}), positive, and ground_m (got {ground_m}), the height"
            " of the terrain"
        )
        raise UsageError(
            f"inpho_prj: {problem}; give them, such as --set focal_mm=35 --set ground_m=500"
        )
    template = PHOTO.format(
        camera=camera.replace("%", "%%"), ground=ground_m / eo.frame.units[1].metres, focal=focal_mm
    )
    table = numbers_of(eo, "xyz matrix", Conventions(attitude=ROTATION_SENSES[1]))
    atomic_write(path, _blocks(eo, photo_ids(eo.images), template, table))


def write_inpho_ascii(eo: FramedOrientation, path: Source) -> None:
    """Write the table of a projected or tangent-plane frame.

    Metres have 4 decimals, degrees 6, seconds of the GPS week 6.

    Parameters
    ----------
    eo : FramedOrientation
        The orientation in its frame.
    path : path
        The file.

    Raises
    ------
    InputError
        Names with blanks or that agree but for their ending.
    DataError
        phi is +-90 deg.
    """
    ids = photo_ids(eo.images)
    angles = (
        "angles: omega phi kappa, deg; R = Rx(omega) Ry(phi) Rz(kappa) rotates camera axes (x"
        " right, y up, z back) to those of the frame"
    )
    comments = (
        comment_lines(eo, angles, "time: seconds of the GPS week, GPS time")
        + "# id E N H omega phi kappa time\n"
    )
    write_columns(eo, path, "image xyz opk tow", " ", comments, ids)


def photo_ids(images: Sequence[str]) -> tuple[str, ...]:
    """Return file names without their endings; InputError where two agree."""
    check_names(images, "\n")
    ids = tuple(PurePath(name).stem for name in images)
    name_by_photo: dict[str, str] = {}
    for name, photo in zip(images, ids, strict=True):
        if name_by_photo.setdefault(photo, name) != name:
            raise InputError(
                f"images {name_by_photo[photo]!r} and {name!r} have the same identifier {photo!r};"
                " rename one"
            )
    return ids


def _blocks(
    eo: FramedOrientation, ids: Sequence[str], form: str, table: np.ndarray
) -> Iterable[str]:
    since = (1000.0 * (WEEK_S * eo.gps_week + eo.time)).round().astype("timedelta64[ms]")
    when = np.datetime_as_string(GPS_EPOCH_MS + since, unit="s")
    for photo, name, t, row in zip(ids, eo.images, when.tolist(), table.tolist(), strict=True):
        yield form % (photo, name, f"{t[11:]} {t[8:10]}/{t[5:7]}/{t[:4]}", *row)
