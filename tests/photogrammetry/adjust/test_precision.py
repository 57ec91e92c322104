"""Covariances against errors, tests against planted errors, variance components."""

from dataclasses import replace

import numpy as np
import pytest
from simulated_blocks import camera, simulated, with_pixels

from insgnss.geodesy.rotation import rotation_from_vector, vector_from_rotation
from insgnss.photogrammetry.adjust.adjustment import adjust_problem
from insgnss.photogrammetry.adjust.groups import (
    InteriorObservation,
    PoseObservation,
    control_points,
    weight_of,
)
from insgnss.photogrammetry.adjust.normals import problem_of
from insgnss.photogrammetry.adjust.precision import NONCENTRALITY, precision_of, strongest
from insgnss.photogrammetry.adjust.separation import inseparable
from insgnss.records.block import INTERIOR

SHAPE = {"strips": 2, "images": 4, "points": 50}
POSE_COV = np.diag([0.05**2] * 3 + [np.radians(0.01) ** 2] * 3)
CALIBRATED = ("f", "cx", "cy", "k1")
CAMERA_COV = np.diag([3.0**2, 2.0**2, 2.0**2, 1e-3**2])


def aerial(made, rng, cov=POSE_COV, claimed=None):
    """Poses measured with errors of `cov`, claimed to be those of `claimed`."""
    P = weight_of(cov if claimed is None else claimed, "pose")
    root = np.sqrt(np.diagonal(cov))
    groups = []
    for i in range(len(made.block.images)):
        d = root * rng.normal(size=6)
        C = rotation_from_vector(d[3:]) @ made.truth.C_mc[i]
        groups.append(PoseObservation(i, made.truth.position[i] + d[:3], C, P))
    return groups


def one_block(seed, backward=False, **claims):
    """A block with aerial and ground control and a calibrated camera, and its adjustment."""
    made = simulated(seed, cameras=(camera(backward, CALIBRATED),), **SHAPE)
    rng = np.random.default_rng([1, seed])
    rows = np.array([INTERIOR.index(name) for name in CALIBRATED])
    cov = CAMERA_COV.copy()
    if backward:
        cov[3, 3] = 1e-6**2
    values = made.truth.interior[0, rows] + np.sqrt(np.diagonal(cov)) * rng.normal(size=4)
    groups = [
        *control_points(made.block.control),
        *aerial(made, rng, **claims),
        InteriorObservation(0, rows, values, weight_of(cov, "camera")),
    ]
    result = adjust_problem(problem_of(made.block, groups), made.truth)
    return made, result, precision_of(result, 1.0)


def within_99_percent(total, freedom):
    from scipy.stats import chi2

    low, high = chi2.ppf((0.005, 0.995), freedom)
    return low < total < high


def nees(e, P):
    return float(e @ np.linalg.solve(P, e))


@pytest.mark.slow
def test_covariances_cover_the_errors_of_thirty_blocks() -> None:
    """Oracle: chi-square, 99 %: poses, points and camera of 30 blocks, sigma_0; components and the
    variance of w are one.
    """
    poses, points, cameras, costs, freedom = [], [], [], 0.0, 0
    w: dict[str, list[np.ndarray]] = {}
    component: dict[str, list[float]] = {}
    for seed in range(30):
        made, result, precision = one_block(seed)
        keys = [("pose", i) for i in range(len(made.block.images))]
        psi = vector_from_rotation(made.truth.C_mc @ result.values.C_mc.swapaxes(1, 2))
        e = np.hstack([made.truth.position - result.values.position, psi]).ravel()
        poses.append(nees(e, precision.cov(*keys)))
        rows = [INTERIOR.index(name) for name in CALIBRATED]
        e = (made.truth.interior - result.values.interior)[0, rows]
        cameras.append(nees(e, precision.cov(("camera", 0))))
        seen = np.flatnonzero(np.isfinite(precision.point_cov[:, 0, 0]))
        p = seen[seed % seen.size]  # one: those of a block share the errors of its poses
        points.append(nees(made.truth.point[p] - result.values.point[p], precision.point_cov[p]))
        costs += result.cost
        freedom += result.redundancy
        for test in precision.groups:
            w.setdefault(test.name, []).append(test.w)
        w.setdefault("image observations", []).append(precision.w[np.isfinite(precision.w)])
        for found in precision.components():
            component.setdefault(found.name, []).append(found.variance)
    for total, count in [(poses, 30 * 48), (cameras, 30 * 4), (points, 30 * 3)]:
        assert within_99_percent(sum(total), count)
    assert within_99_percent(costs, freedom)
    assert set(component) == {
        *("image observations", "ground control", "pose", "interior orientation")
    }
    for name, values in w.items():
        values = np.concatenate(values)
        # within an adjustment they are correlated: four standard deviations of independent ones
        assert np.mean(values**2) == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / values.size)), name
    for name in ("image observations", "pose"):
        assert 0.9 < np.mean(component[name]) < 1.1


@pytest.mark.parametrize("backward", [False, True])
def test_a_group_that_claims_too_much_has_the_largest_component(backward) -> None:
    """Oracle: the simulation: poses that claim variances smaller by 2.5."""
    found = [one_block(s, backward, claimed=POSE_COV / 2.5)[2].components() for s in range(4)]
    by_name = {c.name: [] for c in found[0]}
    for components in found:
        for c in components:
            by_name[c.name].append(c.variance)
    mean = {name: np.mean(v) for name, v in by_name.items()}
    assert mean["pose"] == max(mean["pose"], mean["image observations"])
    assert 1.8 < mean["pose"] < 3.2
    assert 0.85 < mean["image observations"] < 1.15


def test_a_gross_error_has_the_largest_w() -> None:
    """Oracle: the planted error, twice the minimal detectable bias, and what Baarda's test expects
    of it: w grows by twice the non-centrality.
    """
    made, _, precision = one_block(3)
    seen = made.block.observations
    row = int(np.nanargmax(np.where(precision.redundancy[:, 0] > 0.5, 1.0, 0.0)))
    uv = seen.uv.copy()
    uv[row, 0] += 2.0 * precision.detectable_px[row, 0]
    groups = precision.result.problem.groups
    result = adjust_problem(problem_of(with_pixels(made.block, uv), groups), made.truth)
    after = precision_of(result, 1.0)
    grown = after.w[row, 0] - precision.w[row, 0]
    assert grown == pytest.approx(2.0 * NONCENTRALITY, rel=0.02)
    image, point, w = strongest(after, 1)[0]
    assert image == made.block.images[seen.image[row]]
    assert point == made.block.points[seen.point[row]]
    assert w == pytest.approx(abs(after.w[row, 0]))


def test_a_gross_control_point_has_the_largest_w_of_its_group() -> None:
    """Oracle: the planted error of half a metre up."""
    made = simulated(5, cameras=(camera(free=()),), control=8, **SHAPE)
    position = made.block.control.position_m.copy()
    position[4, 2] += 0.5
    control = replace(made.block.control, position_m=position)
    result = adjust_problem(problem_of(made.block, control_points(control)), made.truth)
    tests = precision_of(result, 1.0).groups
    assert int(np.argmax([np.abs(t.w).max() for t in tests])) == 4


def test_correlated_unknowns_are_named() -> None:
    """Oracle: a nadir block over flat control cannot tell the camera constant from the height of
    its images, nor the principal point from their roll and pitch.
    """
    made = simulated(7, cameras=(camera(free=("f", "cx", "k1", "k2", "k3")),), control=8, **SHAPE)
    result = adjust_problem(problem_of(made.block, control_points(made.block.control)), made.truth)
    pairs = inseparable(precision_of(result))
    assert ("k1 of camera one", "k2 of camera one") in {(p.first, p.second) for p in pairs}
    assert [abs(p.value) for p in pairs] == sorted((abs(p.value) for p in pairs), reverse=True)


def test_sigma0_scales_the_covariance() -> None:
    """Oracle: pixels that claim half their noise double sigma_0; the covariance stays."""
    made = simulated(8, cameras=(camera(free=()),), control=6, control_m=1e-3, **SHAPE)
    seen = made.block.observations
    halved = with_pixels(made.block, seen.uv, 0.5 * seen.sigma_px)
    tight = replace(made.block.control, cov=0.25 * made.block.control.cov)
    results = [
        adjust_problem(problem_of(block, control_points(control)), made.truth)
        for block, control in ((made.block, made.block.control), (halved, tight))
    ]
    assert results[1].sigma0 == pytest.approx(2.0 * results[0].sigma0)
    first, second = (precision_of(result).pose_cov for result in results)
    assert second == pytest.approx(first, rel=1e-6, abs=1e-16)
