"""Poses of an adjusted block with standard deviations, `poses.csv`, data_specs/adjusted_poses.md.

    image,x,y,z,omega,phi,kappa,sd_x,sd_y,sd_z,sd_omega,sd_phi,sd_kappa[,...]

Projection centre, m, and angles, deg: Rx(omega) Ry(phi) Rz(kappa) takes the right-up-back camera to
the axes of the block. Columns behind are not read; standard deviations may be missing.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...base.errors import InputError
from ...geodesy.rotation import CV_RUB, opk_jacobian, rotation_from_opk
from ...records.block import Array
from ..text.text import Source

POSE = ("x", "y", "z", "omega", "phi", "kappa")
SIGMA = tuple(f"sd_{name}" for name in POSE)


@dataclass(frozen=True, eq=False)
class AdjustedPoses:
    """Poses of n images.

    Parameters
    ----------
    images : tuple of str
        Their names.
    position_m : ndarray, (n, 3)
        Projection centres, m.
    C_mc : ndarray, (n, 3, 3)
        Camera (right, down, viewing direction) to the axes of the block.
    cov : ndarray, (n, 6, 6), or None
        Covariance of position (m) and psi (rad); None without standard deviations.
    """

    images: tuple[str, ...]
    position_m: Array
    C_mc: Array
    cov: Array | None


def is_adjusted_poses(text: str) -> bool:
    """Tell whether the beginning of a file is that of such a table."""
    head = next((x for x in text.splitlines() if x.strip() and not x.startswith("#")), "")
    columns = [name.strip().lower() for name in head.split(",")]
    return columns[:7] == ["image", *POSE]


def read_adjusted_poses(path: Source) -> AdjustedPoses:
    """Read the table.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    AdjustedPoses
        The poses, in the order of the file.

    Raises
    ------
    InputError
        With file and line: a column is missing, a value is no number, an image stands twice.
    """
    path = Path(path)
    columns: list[str] | None = None
    names: list[str] = []
    rows: list[list[float]] = []
    seen: dict[str, int] = {}
    has_sigma = False
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        if not line.strip() or line.startswith("#"):
            continue
        words = [word.strip() for word in line.split(",")]
        if columns is None:
            columns = [word.lower() for word in words]
            if missing := [name for name in ("image", *POSE) if name not in columns]:
                raise InputError.at_line(path, number, f"no column {missing[0]}")
            has_sigma = all(name in columns for name in SIGMA)
            continue
        if len(words) != len(columns):
            problem = f"{len(words)} values, {len(columns)} columns"
            raise InputError.at_line(path, number, problem)
        given = dict(zip(columns, words, strict=True))
        image = given["image"]
        if image in seen:
            problem = f"image {image} stands in line {seen[image]} as well"
            raise InputError.at_line(path, number, problem)
        seen[image] = number
        values = []
        for name in (*POSE, *(SIGMA if has_sigma else ())):
            try:
                values.append(float(given[name]))
            except ValueError:
                values.append(np.nan)
            if not np.isfinite(values[-1]):
                problem = f"{name} = {given[name]!r} is no number"
                raise InputError.at_line(path, number, problem)
            if name in SIGMA and not values[-1] > 0.0:
                problem = f"{name} = {given[name]} is no standard deviation"
                raise InputError.at_line(path, number, problem)
        names.append(image)
        rows.append(values)
    if not rows:
        raise InputError.at_line(path, None, "no poses; lines image,x,y,z,omega,phi,kappa")
    table = np.array(rows)
    opk = np.radians(table[:, 3:6])
    cov = None
    if has_sigma:
        E = opk_jacobian(opk)
        cov = np.zeros((len(rows), 6, 6))
        diagonal = np.arange(3)
        cov[:, diagonal, diagonal] = table[:, 6:9] ** 2
        angles = np.radians(table[:, 9:12])
        cov[:, 3:, 3:] = (E * angles[:, None, :] ** 2) @ E.swapaxes(1, 2)
    return AdjustedPoses(tuple(names), table[:, :3], rotation_from_opk(opk) @ CV_RUB, cov)
