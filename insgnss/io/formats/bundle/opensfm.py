"""OpenSfM's exif_overrides.json with reference_lla.json beside it, data_specs/opensfm.md.

omega, phi, kappa, R = Rx(omega) Ry(phi) Rz(kappa), take the camera (right, up, back) to east,
north, up of the reconstruction's reference, not of the image: 32 seconds of arc a kilometre. So the
frame is a tangent plane, and its origin is written as the reference, which OpenSfM would otherwise
choose itself. `dop` and `accuracy` are single numbers: root mean squares of three standard
deviations, of the position in m and of psi in degrees.
"""

import json
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from ....base.errors import UsageError
from ....base.files import atomic_writes
from ....base.output.staging import destination
from ....records import FramedOrientation
from ..orientation.ascii_columns import numbers_of
from ..orientation.exported import listed_rows
from ..text.text import Source

REFERENCE = "reference_lla.json"


def write_opensfm(eo: FramedOrientation, path: Source) -> None:
    """Write a tangent plane's positions, angles and accuracies, and its origin beside `path`.

    The origin stands in reference_lla.json. Degrees have 10 decimals (position) and 6 (angles),
    metres 4.

    Parameters
    ----------
    eo : FramedOrientation
        The orientation in a tangent plane.
    path : path
        The file.

    Raises
    ------
    UsageError
        Another reference_lla.json beside `path`.
    DataError
        phi is +-90 deg.
    """
    lat, lon, height = (float(x) for x in eo.frame.origin)
    reference = json.dumps(
        {
            "latitude": float(np.degrees(lat)),
            "longitude": float(np.degrees(lon)),
            "altitude": height,
        },
        indent=1,
    )
    reference_file = Path(path).with_name(REFERENCE)
    present = destination(reference_file)
    if present.exists() and present.read_text(encoding="utf-8") != reference:
        raise UsageError(
            f"{present}: holds another reference than this export, which would make its angles"
            " wrong; delete the file or export elsewhere"
        )
    # of position, of psi
    sigma = np.sqrt(np.diagonal(eo.cov, axis1=1, axis2=2).reshape(-1, 2, 3).mean(axis=2))
    table = np.hstack(
        [numbers_of(eo, "llh"), sigma[:, :1], numbers_of(eo, "opk"), np.degrees(sigma[:, 1:])]
    )
    atomic_writes({Path(path): _entries(eo.images, table), reference_file: reference})


def _entries(images: tuple[str, ...], table: np.ndarray) -> Iterable[str]:
    gps = '{"gps": {"latitude": %.10f, "longitude": %.10f, "altitude": %.4f, "dop": %.5f}'
    form = "%s: " + gps + ', "opk": {"omega": %.6f, "phi": %.6f, "kappa": %.6f, "accuracy": %.6f}}'
    rows = zip(map(json.dumps, images), table.tolist(), strict=True)
    return listed_rows("{\n", (form % (name, *row) for name, row in rows), ",\n", "\n}\n")
