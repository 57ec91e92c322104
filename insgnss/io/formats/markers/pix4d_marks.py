"""Marks of tie points for PIX4Dmatic, data_specs/pix4d_marks.md."""

import numpy as np

from ....base.files import atomic_write
from ..blocks.image_points import ImagePoints
from ..orientation.exported import check_names
from ..text.text import Source


def write_pix4d_marks(measured: ImagePoints, path: Source) -> None:
    """Write where images show ground points.

    Parameters
    ----------
    measured : ImagePoints
        Image observations.
    path : path
        The file, written whole or not at all.

    Raises
    ------
    InputError
        A name that the file cannot hold.
    UsageError
        The file cannot be written.
    """
    check_names(measured.images, ",")
    check_names(measured.points, ",", "point")
    obs = measured.observations
    sigma = np.sqrt(np.mean(obs.sigma_px**2, axis=1))
    rows = (
        f"{measured.images[i]},{measured.points[p]},{u:.4f},{v:.4f},{s:.4g}\n"
        for i, p, (u, v), s in zip(
            obs.image.tolist(), obs.point.tolist(), obs.uv.tolist(), sigma.tolist(), strict=True
        )
    )
    atomic_write(path, "".join(rows))
