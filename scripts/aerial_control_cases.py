"""Table 4 of paper 003 (Rehak and Skaloud 2016), and its modes as options of a block file."""

import os
from dataclasses import dataclass, replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # on a shared machine more threads only spin

import numpy as np

from insgnss.flight.config.block_file import BlockFile, load_block
from insgnss.geodesy.rotation import vector_from_rotation
from insgnss.io.formats.blocks.image_points import ImagePoints, write_image_points
from insgnss.photogrammetry.adjust.normals import cofactors_of
from insgnss.photogrammetry.adjust.unknowns import POSE
from insgnss.photogrammetry.block_adjustment.inputs import inputs_of
from insgnss.photogrammetry.block_adjustment.residuals.check_points import check_points
from insgnss.photogrammetry.block_adjustment.solve import AdjustedBlock, solve_block
from insgnss.records.block import ImageObservations
from insgnss.simulation.plug import import_plugged

write_survey = import_plugged("published_blocks.files").write_survey
SimulatedSurvey = import_plugged("published_blocks.survey").SimulatedSurvey

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
GYRO = {"gyro_noise_deg_rts": 0.02, "gyro_drift_degps": 0.008, "gyro_vertical": 4.0}
"""Equation 6 with figures that come near to what neighbours of the simulated poses differ by."""
OF_GROUND = "ground_in_images.csv"
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


def written(directory: Path, made: SimulatedSurvey) -> Path:
    """Write a block, and beside it the image observations of its surveyed points alone."""
    file = write_survey(directory, made)
    write_image_points(ground_alone(made), file.with_name(OF_GROUND))
    return file


def ground_alone(made: SimulatedSurvey) -> ImagePoints:
    """Return the image observations of surveyed points."""
    seen, names = made.measured.observations, made.measured.points
    first = names.index(made.ground.points[0])
    keep = seen.point >= first
    observed = ImageObservations(
        seen.image[keep], seen.point[keep] - first, seen.uv[keep], seen.sigma_px[keep]
    )
    return ImagePoints(made.measured.images, names[first:], observed)


def in_mode(
    file: BlockFile | Path, mode: str, weights: str = "smoothed", boresight_deg: float = 0.0
) -> BlockFile:
    """Return a block file in one of `MODES`.

    weights : "smoothed": the whole covariance of all poses; "independent": each image, or each pair
        of neighbours, by itself (the paper's standard deviations and its equation 5); "gyro": the
        same with equation 6 for relative attitudes.
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
            aerial,
            control=control,
            relative_weights=weights if "R" in control else "smoothed",
            boresight_sigma_deg=sigma,
            covariance="strip" if weights == "smoothed" else "image",
            **GYRO,
        )
    images = file.images
    if way in ("fast_at", "direct"):
        # no tie points take part, so that they are not read either
        images = replace(images, file=file.path.with_name(OF_GROUND))
        camera = replace(camera, file=camera.file.with_name("camera_calibrated.toml"))
    adjustment = replace(file.adjustment, mode=way)
    return replace(file, images=images, aerial_control=aerial, camera=camera, adjustment=adjustment)


@dataclass(frozen=True)
class Outcome:
    """Check points, and what the covariance says of them and of the poses.

    difference_m : (m, 3) adjusted minus surveyed.
    sigma_m : (m, 3) promised standard deviations of these.
    normalised : square of all differences together over 3 m.
    poses : mean normalised square of the poses over 6; of neighbours over 3: `neighbours`.
    promised_m, actual_m : (2) root mean squares of errors of relative positions of neighbours, and
        of the first and last image of a line, by the covariance and by the truth, each axis.
    """

    difference_m: np.ndarray
    sigma_m: np.ndarray
    normalised: float
    poses: float
    promised_m: np.ndarray
    actual_m: np.ndarray
    neighbours: float


def solution(file: BlockFile) -> AdjustedBlock:
    """Adjust a block, without judgement."""
    return solve_block(inputs_of(file, lambda _: None), lambda _: None)


def outcome(file: BlockFile, made: SimulatedSurvey, poses: bool = True) -> Outcome:
    """Adjust a block, without judgement, and hold it (and its poses) against the truth."""
    return compared(solution(file), made, poses)


def compared(done: AdjustedBlock, made: SimulatedSurvey, poses: bool = True) -> Outcome:
    """Hold an adjusted block against the truth."""
    points = check_points(done)
    block = done.result.problem.block
    names = [block.points[p] for p in block.check.point[points.rows]]
    wanted = {p for p, c in zip(made.ground.points, made.ground.check, strict=True) if c}
    keep = np.flatnonzero([name in wanted for name in names])
    columns = (3 * keep[:, None] + np.arange(3)).ravel()
    cov = points.cov_of_differences[np.ix_(columns, columns)]
    d = points.difference_m[keep]
    square = float(d.ravel() @ np.linalg.solve(cov, d.ravel())) / d.size
    sigma = np.sqrt(np.diagonal(cov)).reshape(-1, 3)
    return Outcome(-d, sigma, square, *of_poses(done, made, poses))


def of_poses(done: AdjustedBlock, made: SimulatedSurvey, wanted: bool) -> tuple:
    """Return the last four of `Outcome`; nan where poses are held or not wanted."""
    if done.direct or not wanted:
        return np.nan, np.full(2, np.nan), np.full(2, np.nan), np.nan
    problem, values = done.result.problem, done.result.values
    row = {name: k for k, name in enumerate(made.truth.images)}
    rows = [row[name] for name in problem.block.images]
    X, C = made.truth.position_m[rows], made.truth.C_mc[rows]
    e = np.hstack([X - values.position, vector_from_rotation(C @ values.C_mc.swapaxes(1, 2))])
    P = done.precision.pose_cov
    square = float(np.einsum("ni,nij,nj->n", e, np.linalg.inv(P), e).mean()) / 6.0
    here = {k: i for i, k in enumerate(rows)}
    columns = np.concatenate([problem.layout.of((POSE, i))[0][:3] for i in range(len(rows))])
    Q = cofactors_of(problem, values, columns).reshape(len(rows), 3, len(rows), 3)
    promised, actual, normalised = [], [], []
    for strip in made.strips:
        line = [here[k] for k in strip.rows if k in here]
        pairs = [(line[k], line[k + 1]) for k in range(0, len(line) - 1, 2)]
        for i, j in [*pairs, (line[0], line[-1])]:
            cov = Q[i, :, i] + Q[j, :, j] - Q[i, :, j] - Q[j, :, i]
            off = e[j, :3] - e[i, :3]
            promised.append(np.trace(cov) / 3.0)
            actual.append(off @ off / 3.0)
            normalised.append(off @ np.linalg.solve(cov, off) / 3.0)
    ends = np.cumsum([(len(strip.rows)) // 2 + 1 for strip in made.strips]) - 1
    whole = np.zeros(len(promised), dtype=bool)
    whole[ends] = True
    both = [
        np.array([np.mean(np.array(x)[~whole]), np.mean(np.array(x)[whole])])
        for x in (promised, actual)
    ]
    return square, np.sqrt(both[0]), np.sqrt(both[1]), float(np.mean(np.array(normalised)[~whole]))
