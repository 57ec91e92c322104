"""Simulated blocks with aerial control through a mounting, for what a flight plan tells apart."""

from dataclasses import dataclass

import numpy as np
from simulated_blocks import no_ground

from insgnss.geodesy.rotation import CV_RUB, rotation_from_opk
from insgnss.photogrammetry.adjust.adjustment import Adjusted
from insgnss.photogrammetry.adjust.aerial import (
    BORESIGHT,
    CAMERA_LEVER_ARM,
    EXPOSURE_DELAY,
    SHIFT,
    AerialControl,
    ParameterObservation,
)
from insgnss.photogrammetry.adjust.groups import InteriorObservation, control_points
from insgnss.photogrammetry.adjust.normals import problem_of
from insgnss.photogrammetry.adjust.precision import Precision, precision_of
from insgnss.photogrammetry.adjust.unknowns import Unknowns
from insgnss.records.block import INTERIOR, BrownCamera, GroundPoints, ImageBlock, ImageObservations
from insgnss.records.cameras.camera import pixels_of

POSITION_M, ATTITUDE = 0.02, np.radians(0.01)


@dataclass(frozen=True)
class Plan:
    """A flight plan: one heading, one height, one speed by default, over nearly flat ground.

    headings_deg, heights_m, speeds_mps, tilts_deg : of each strip.
    control : number of ground control points.
    relief_m : differences of height of the ground.
    free : parameters of interior orientation that are unknowns.
    mounting : blocks that are unknowns.
    aerial : whether positions and attitudes are observed.
    calibrated_px : standard deviation of cx and cy of a calibration, if there is one.
    portrait : whether the longer side of the image lies along y.
    """

    headings_deg: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)
    heights_m: tuple[float, ...] = (100.0, 100.0, 100.0, 100.0)
    speeds_mps: tuple[float, ...] = (12.0, 12.0, 12.0, 12.0)
    tilts_deg: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)
    control: int = 0
    relief_m: float = 4.0
    free: tuple[str, ...] = ("f", "cx", "cy")
    mounting: tuple[str, ...] = ()
    aerial: bool = True
    seed: int = 1
    points: int = 250
    images: int = 6
    f_px: float = 4000.0
    calibrated_px: float = 0.0
    portrait: bool = False


def precision_expected(plan: Plan) -> Precision:
    """The precision of a block that is flown so, at the true values."""
    rng = np.random.default_rng(plan.seed)
    size = np.array([3800, 5000] if plan.portrait else [5000, 3800])
    value = {"f": plan.f_px, "cx": size[0] / 2.0, "cy": size[1] / 2.0}
    interior = np.array([value.get(n, 0.0) for n in INTERIOR])
    camera = BrownCamera("one", int(size[0]), int(size[1]), interior, free=plan.free)
    n, strips = plan.images, len(plan.headings_deg)
    position, C, velocity = [], [], []
    for k in range(strips):
        course = np.radians(plan.headings_deg[k])
        along = np.array([np.cos(course), np.sin(course), 0.0])
        across = np.array([-along[1], along[0], 0.0])
        start = across * 45.0 * (k - (strips - 1) / 2) * np.cos(course)
        place = start + np.outer(25.0 * (np.arange(n) - (n - 1) / 2), along)
        place = place + rng.normal(0.0, 1.0, (n, 3)) + (0.0, 0.0, plan.heights_m[k])
        opk = np.radians(rng.normal(0.0, 1.0, (n, 3)))
        opk[:, 1] += np.radians(plan.tilts_deg[k])
        turn = np.array([[along[0], across[0], 0], [along[1], across[1], 0], [0, 0, 1.0]])
        position.append(place)
        C.append(turn @ rotation_from_opk(opk) @ CV_RUB)
        velocity.append(np.tile(plan.speeds_mps[k] * along, (n, 1)))
    X = rng.uniform(-130.0, 130.0, (plan.points, 3)) * (1.0, 1.0, 0.0)
    X[:, 2] = plan.relief_m * rng.uniform(-0.5, 0.5, plan.points)
    centre, turned = np.concatenate(position), np.concatenate(C)
    rows, uv = [], []
    for i in range(len(centre)):
        q = (X - centre[i]) @ turned[i]
        pixel = pixels_of(camera, q[:, :2] / q[:, 2:])
        seen = ((pixel > 0.0) & (pixel < size)).all(axis=1) & (q[:, 2] > 0.0)
        rows.append(np.column_stack([np.full(seen.sum(), i), np.flatnonzero(seen)]))
        uv.append(pixel[seen])
    where, pixels = np.concatenate(rows), np.concatenate(uv)
    count = np.bincount(where[:, 1], minlength=len(X))
    keep = (count >= 2)[where[:, 1]]
    where, pixels = where[keep], pixels[keep]
    chosen = np.flatnonzero(count >= 3)
    chosen = chosen[np.linspace(0, chosen.size - 1, plan.control).astype(int)]
    control = (
        GroundPoints(chosen, X[chosen], np.tile(np.eye(3) * 0.01**2, (len(chosen), 1, 1)))
        if plan.control
        else no_ground()
    )
    block = ImageBlock(
        (camera,),
        tuple(f"i{i}" for i in range(len(centre))),
        np.zeros(len(centre), dtype=np.int64),
        centre,
        turned,
        np.zeros((len(centre), 6), dtype=bool),
        tuple(f"p{p}" for p in range(len(X))),
        ImageObservations(where[:, 0], where[:, 1], pixels, np.full(pixels.shape, 0.5)),
        control,
        no_ground(),
    )
    blocks, groups = {}, control_points(control)
    zero = {CAMERA_LEVER_ARM: np.zeros(3), BORESIGHT: np.eye(3), EXPOSURE_DELAY: np.zeros(1)}
    zero |= {SHIFT: np.zeros(3)}
    loose = {CAMERA_LEVER_ARM: 1.0, BORESIGHT: 0.1, EXPOSURE_DELAY: 1.0, SHIFT: 1.0}
    if plan.calibrated_px:
        P = np.eye(2) / plan.calibrated_px**2
        groups.append(InteriorObservation(0, np.array([1, 2]), interior[1:3], P))
    for name in plan.mounting:
        blocks[(name, 0)] = zero[name]
        P = np.eye(1 if name == EXPOSURE_DELAY else 3) / loose[name] ** 2
        groups.append(ParameterObservation((name, 0), zero[name], P))
    P = np.kron(np.eye(n), np.diag([1 / POSITION_M**2] * 3 + [1 / ATTITUDE**2] * 3))
    for k in range(strips if plan.aerial else 0):
        groups.append(
            AerialControl(
                tuple(range(k * n, k * n + n)),
                position[k],
                C[k],
                P,
                2.0 * np.arange(n),
                velocity[k],
                np.zeros((n, 3)),
                dict.fromkeys(plan.mounting, 0),
            )
        )
    values = Unknowns(centre, turned, camera.interior[None].copy(), X, blocks)
    problem = problem_of(block, groups, blocks)
    return precision_of(Adjusted(problem, values, 1.0, 0, 1), 1.0)
