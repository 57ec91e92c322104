"""Table 4 of paper 003 (Rehak and Skaloud 2016), and its modes as options of a block file."""

import os
from dataclasses import dataclass, replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # on a shared machine more threads only spin

import numpy as np

from insgnss.block_adjustment.check_points import check_points
from insgnss.block_adjustment.inputs import inputs_of
from insgnss.block_adjustment.solve import Solved, solved
from insgnss.config.block_file import BlockFile, load_block
from insgnss.geodesy.rotation import vector_from_rotation
from insgnss.simulation.published_blocks.survey import SimulatedSurvey

MODES = {  # mode and control
    "Indirect SO": ("indirect", None),
    "ISO Ap Aa": ("iso", "Ap/Aa"),
    "ISO Ap Ra": ("iso", "Ap/Ra"),
    "ISO Rp Ra": ("iso", "Rp/Ra"),
    "F. AT Ap Aa": ("fast_at", "Ap/Aa"),
    "F. AT Ap Ra": ("fast_at", "Ap/Ra"),
    "F. AT Rp Ra": ("fast_at", "Rp/Ra"),
    "DiSO": ("direct", "Ap/Aa"),
}
PUBLISHED = {  # mm: mean X Y Z, root mean square X Y Z of Table 4, as printed
    "block2015": {
        "Indirect SO": (68, 8, -664, 16, 145, 1171),
        "ISO Ap Aa": (6, 16, 35, 32, 29, 53),
        "ISO Ap Ra": (5, 16, 32, 30, 28, 53),
        "ISO Rp Ra": (-38, 39, 16, 52, 58, 42),
        "F. AT Ap Aa": (9, -21, 7, 37, 45, 65),
        "F. AT Ap Ra": (8, 38, -22, 24, 47, 61),
        "F. AT Rp Ra": (-42, -2, -38, 78, 32, 58),
        "DiSO": (-5, -13, -15, 52, 63, 166),
    },
    "corridor2014": {
        "Indirect SO": (319, 662, -4226, 476, 1043, 541.7),
        "ISO Ap Aa": (-3, -3, -3, 33, 35, 86),
        "ISO Ap Ra": (42, -11, -21, 66, 43, 86),
        "ISO Rp Ra": (72, 18, 84, 94, 94, 137),
        "F. AT Ap Aa": (-33, -49, 12, 93, 60, 120),
        "F. AT Ap Ra": (-5, -13, -2, 163, 85, 167),
        "F. AT Rp Ra": (56, -21, -123, 204, 88, 233),
        "DiSO": (-13, -13, -25, 91, 38, 171),
    },
}
BLOCKS = tuple(PUBLISHED)


def in_mode(
    file: BlockFile | Path, mode: str, weights: str = "smoothed", boresight_deg: float = 0.0
) -> BlockFile:
    """Return a block file in one of `MODES`.

    weights : of relative control.
    boresight_deg : standard deviation of the bore-sight where attitudes are absolute; 0: it is
        known.
    """
    file = load_block(file) if isinstance(file, Path) else file
    way, control = MODES[mode]
    aerial, camera = file.aerial_control, file.camera
    if control is None:
        aerial = replace(aerial, boresight_sigma_deg=0.0)
    else:
        sigma = boresight_deg if control.endswith("Aa") and way != "direct" else 0.0
        aerial = replace(
            aerial, control=control, relative_weights=weights, boresight_sigma_deg=sigma
        )
    if way in ("fast_at", "direct"):
        camera = replace(camera, file=camera.file.with_name("camera_calibrated.toml"))
    adjustment = replace(file.adjustment, mode=way)
    return replace(file, aerial_control=aerial, camera=camera, adjustment=adjustment)


@dataclass(frozen=True)
class Outcome:
    """Check points, and what the covariance says of them and of the poses.

    difference_m : (m, 3) adjusted minus surveyed.
    sigma_m : (m, 3) promised standard deviations of these.
    normalised : square of all differences together over 3 m.
    poses : mean normalised square of the poses over 6.
    relative : (6) root mean square of promised over actual errors of position and attitude of
        neighbours in lines: promised (3: E N U), actual (3), m.
    """

    difference_m: np.ndarray
    sigma_m: np.ndarray
    normalised: float
    poses: float
    relative: np.ndarray
    solved: Solved


def outcome(file: BlockFile, made: SimulatedSurvey) -> Outcome:
    """Adjust a block, without judgement, and hold it against the truth."""
    done = solved(inputs_of(file, lambda _: None), lambda _: None)
    points = check_points(done)
    block = done.result.problem.block
    names = [block.points[p] for p in block.check.point[points.rows]]
    wanted = {p for p, c in zip(made.ground.points, made.ground.check, strict=True) if c}
    keep = np.flatnonzero([name in wanted for name in names])
    columns = (3 * keep[:, None] + np.arange(3)).ravel()
    cov = points.cov_of_differences[np.ix_(columns, columns)]
    d = points.difference_m[keep]
    square = float(d.ravel() @ np.linalg.solve(cov, d.ravel())) / d.size
    poses, relative = of_poses(done, made)
    sigma = np.sqrt(np.diagonal(cov)).reshape(-1, 3)
    return Outcome(-d, sigma, square, poses, relative, done)


def of_poses(done: Solved, made: SimulatedSurvey) -> tuple[float, np.ndarray]:
    """Return the mean normalised square of poses over 6, and of neighbours see `Outcome`."""
    values, images = done.result.values, done.result.problem.block.images
    row = {name: k for k, name in enumerate(made.truth.images)}
    rows = [row[name] for name in images]
    X, C = made.truth.position_m[rows], made.truth.C_mc[rows]
    e = np.hstack([X - values.position, vector_from_rotation(C @ values.C_mc.swapaxes(1, 2))])
    if done.direct:
        return float("nan"), np.full((2, 3), np.nan)
    P = done.precision.pose_cov
    square = float(np.einsum("ni,nij,nj->n", e, np.linalg.inv(P), e).mean()) / 6.0
    return square, np.full((2, 3), np.nan)
