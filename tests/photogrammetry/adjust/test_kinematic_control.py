"""A target on a vehicle: places with one covariance, sizes, and what stands between."""

from dataclasses import replace

import numpy as np
import pytest
from draws import lower_factor
from scipy.stats import chi2
from simulated_blocks import camera, simulated

from insgnss.base.errors import InputError
from insgnss.geodesy.rotation import rotation_from_rpy, rotation_from_vector
from insgnss.photogrammetry.adjust.adjustment import adjust_problem
from insgnss.photogrammetry.adjust.aerial import EXPOSURE_DELAY, ParameterObservation
from insgnss.photogrammetry.adjust.groups import control_points, weight_of
from insgnss.photogrammetry.adjust.kinematic import (
    KINEMATIC_CONTROL,
    SIZE,
    TARGET_ARM,
    VEHICLE_CLOCK,
    VEHICLE_SHIFT,
    KinematicControl,
    TargetSize,
    gauss_markov,
)
from insgnss.photogrammetry.adjust.normals import problem_of
from insgnss.photogrammetry.adjust.precision import precision_of
from insgnss.photogrammetry.adjust.unknowns import POINT
from insgnss.records.block import INTERIOR, ImageObservations
from insgnss.records.cameras.camera import pixels_of

ARM, DELAY = np.array([0.4, -0.2, -2.1]), 0.012
SHIFT, OFFSET, SIZE_M = np.array([0.05, -0.04, 0.08]), 0.004, 1.2
BLOCKS = {
    (TARGET_ARM, 0): ARM,
    (VEHICLE_CLOCK, 0): np.array([DELAY]),
    (VEHICLE_SHIFT, 0): SHIFT,
    (EXPOSURE_DELAY, 0): np.array([OFFSET]),
}
NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
SIGMA = np.array([0.02, 0.02, 0.04])


def driven(seed, free=("f",), noise_px=0.5):
    """A block with a target of its own in every image, nearly below the camera."""
    made = simulated(seed, strips=2, images=5, points=80, cameras=(camera(free=free),), control=5)
    rng = np.random.default_rng(seed + 1000)
    block, truth = made.block, made.truth
    n = len(block.images)
    K = truth.position + rng.uniform(-8.0, 8.0, (n, 3)) * (1.0, 1.0, 0.0)
    K[:, 2] = rng.uniform(0.0, 8.0, n)
    q = np.einsum("nij,ni->nj", truth.C_mc, K - truth.position)
    uv = pixels_of(block.cameras[0], q[:, :2] / q[:, 2:]) + noise_px * rng.standard_normal((n, 2))
    seen = block.observations
    first = len(block.points)
    observations = ImageObservations(
        np.concatenate([seen.image, np.arange(n)]),
        np.concatenate([seen.point, first + np.arange(n)]),
        np.vstack([seen.uv, uv]),
        np.vstack([seen.sigma_px, np.full((n, 2), noise_px)]),
    )
    block = replace(
        block, points=(*block.points, *(f"K{i}" for i in range(n))), observations=observations
    )
    truth = replace(truth, point=np.vstack([truth.point, K]))
    heading = rng.uniform(-np.pi, np.pi, n)
    C = NED.T @ rotation_from_rpy(np.column_stack([*rng.normal(0.0, 0.05, (2, n)), heading]))
    v = 6.0 * C[:, :, 0]
    size = 5607.0 * SIZE_M / q[:, 2] + 0.3 * rng.standard_normal(n)
    return replace(made, block=block, truth=truth), first + np.arange(n), C, v, size


def covariance(n):
    """A share that lasts 300 s, exposures 3 s apart."""
    return np.kron(gauss_markov(3.0 * np.arange(n), 0.75, 300.0), np.diag(SIGMA**2))


def group_of(made, points, C, v, rng, parameters=None, cov=None):
    """(J.21) at the truth, with errors."""
    P = covariance(len(points)) if cov is None else cov
    e = (lower_factor(P) @ rng.standard_normal(len(P))).reshape(-1, 3)
    X = made.truth.point[points] - C @ ARM - v * (OFFSET - DELAY) + SHIFT - e
    parameters = dict.fromkeys(name for name, _ in BLOCKS) if parameters is None else parameters
    return KinematicControl(
        tuple(points.tolist()), X, weight_of(P, "v"), v, C, dict.fromkeys(parameters, 0)
    )


def moved(values, problem, key, k, step):
    """Values after a step of one parameter of a block."""
    dx, dp = np.zeros(problem.layout.size), np.zeros_like(values.point)
    if key[0] == POINT:
        dp[key[1], k] = step
    else:
        dx[problem.layout.of(key)[0][k]] = step
    return values.moved(problem.layout, dx, dp)


def numerical(group, values, problem, keys):
    """d computed / d unknown by central differences."""
    out = []
    for key in keys:
        for k in range(problem.layout.of(key)[0].size):
            ahead, behind = (
                group.linearised(moved(values, problem, key, k, s))[0] for s in (1e-6, -1e-6)
            )
            out.append(-(ahead - behind) / 2e-6)
    return np.column_stack(out)


def test_derivatives_of_places() -> None:
    """Oracle: central differences through `Unknowns.moved`; and (J.21) by itself at the truth."""
    made, points, C, v, _ = driven(3)
    group = group_of(made, points, C, v, np.random.default_rng(5), cov=1e-18 * covariance(10))
    problem = problem_of(made.block, [group], BLOCKS)
    values = replace(made.truth, blocks=BLOCKS)
    e, J = group.linearised(values)
    assert np.abs(e).max() < 1e-8
    assert group.keys[10:] == (
        (TARGET_ARM, 0),
        (VEHICLE_CLOCK, 0),
        (VEHICLE_SHIFT, 0),
        (EXPOSURE_DELAY, 0),
    )
    assert pytest.approx(numerical(group, values, problem, group.keys), abs=1e-8) == J


def test_derivatives_of_sizes() -> None:
    """Oracle: central differences, far from the truth; and two points on the disc, projected."""
    made, points, _, _, _ = driven(7, free=("f", "cx", "k1"))
    turned = rotation_from_vector(np.array([0.2, -0.3, 0.1])) @ made.truth.C_mc
    blocks = {(SIZE, 0): np.array([0.01])}
    values = replace(made.truth, C_mc=turned, blocks=blocks)
    group = TargetSize(4, 0, int(points[4]), 60.0, 0.3, SIZE_M, True)
    problem = problem_of(made.block, [group], blocks)
    e, J = group.linearised(values)
    columns = [INTERIOR.index(name) for name in ("f", "cx", "k1")]
    J = J[:, [*range(6), *(6 + k for k in columns), *range(17, 21)]]
    assert pytest.approx(numerical(group, values, problem, group.keys), abs=1e-6) == J
    # the diameter parallel to the image: both ends at the depth of the centre, level
    axis = turned[4][:, 2]
    along = np.cross(axis, [0.0, 0.0, 1.0])
    ends = made.truth.point[points[4]] + 0.5 * (SIZE_M + 0.01) * np.outer(
        [1.0, -1.0], along / np.linalg.norm(along)
    )
    q = (ends - made.truth.position[4]) @ turned[4]
    uv = 5607.0 * q[:, :2] / q[:, 2:]
    assert 60.0 - e[0] == pytest.approx(np.linalg.norm(uv[0] - uv[1]), rel=1e-12)


@pytest.mark.slow
def test_whole_adjustments_are_as_good_as_they_say() -> None:
    """Oracle: chi-square of normalised squares over seeds: parameters, camera, targets. With
    diagonal weights of the same places the shift claims too much (2.3 times its variance).
    """
    totals: dict[str, float] = {}
    count: dict[str, int] = {}
    for seed in range(20):
        made, points, C, v, size = driven(seed)
        rng = np.random.default_rng(seed + 77)
        group = group_of(made, points, C, v, rng)
        priors = {TARGET_ARM: 0.02, VEHICLE_CLOCK: 0.005, VEHICLE_SHIFT: 0.1, EXPOSURE_DELAY: 0.002}
        groups = [group, *control_points(made.block.control)]
        first = {}
        for key, value in BLOCKS.items():
            error = priors[key[0]] * rng.standard_normal(value.size)
            first[key] = value - error
            P = np.eye(value.size) / priors[key[0]] ** 2
            groups.append(ParameterObservation(key, first[key], P, key[0]))
        groups += [
            TargetSize(i, 0, int(p), float(s), 0.3, SIZE_M)
            for i, (p, s) in enumerate(zip(points, size, strict=True))
        ]
        diagonal = replace(group, weight=np.diag(1.0 / np.diagonal(covariance(len(points)))))
        for name, own in (("whole", groups), ("diagonal", [diagonal, *groups[1:]])):
            problem = problem_of(made.block, own, first)
            result = adjust_problem(problem, replace(made.truth, blocks=first))
            precision = precision_of(result, 1.0)
            cases = {
                "parameters": [*BLOCKS],
                "shift": [(VEHICLE_SHIFT, 0)],
                "targets": [(POINT, int(p)) for p in points],
            }
            for case, keys in cases.items():
                e = np.concatenate(
                    [
                        made.truth.point[k[1]] - result.values.point[k[1]]
                        if k[0] == POINT
                        else BLOCKS[k] - result.values.blocks[k]
                        for k in keys
                    ]
                )
                nees = float(e @ np.linalg.solve(precision.cov(*keys), e))
                totals[f"{name} {case}"] = totals.get(f"{name} {case}", 0.0) + nees
                count[f"{name} {case}"] = count.get(f"{name} {case}", 0) + e.size
    for name, total in totals.items():
        if name.startswith("whole"):
            low, high = chi2.ppf((0.0005, 0.9995), count[name])
            assert low < total < high, name
    assert totals["diagonal shift"] > 1.4 * totals["whole shift"]


def test_a_place_costs_three_columns() -> None:
    """Oracle: the columns that stay, three a place beside poses and camera."""
    made, points, C, v, _ = driven(1)
    group = group_of(made, points, C, v, np.random.default_rng(1), parameters=())
    problem = problem_of(made.block, [group])
    assert problem.layout.size == 60 + 1 + 30
    assert (problem.layout.kept[points] >= 0).all()
    assert (problem.layout.kept[: points[0]] < 0).all()


def test_what_cannot_be_is_refused() -> None:
    """Oracle: the list of parameters, shapes, signs."""
    made, points, C, v, _ = driven(1)
    group = group_of(made, points, C, v, np.random.default_rng(1))
    assert group.name == KINEMATIC_CONTROL
    with pytest.raises(InputError, match="tilt is none of lever arm of the target, delay"):
        replace(group, parameters={"tilt": 0})
    with pytest.raises(InputError, match=r"weight: shape \(5, 5\)"):
        replace(group, weight=np.eye(5))
    with pytest.raises(InputError, match=r"size_m 0; it must be positive"):
        TargetSize(0, 0, 0, 50.0, 0.3, 0.0)
