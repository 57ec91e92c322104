"""Poses of a trajectory as observations, with what stands between it and the camera."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from draws import lower_factor
from numpy.testing import assert_allclose
from scipy.linalg import block_diag
from simulated_blocks import camera, simulated

from insgnss.base.errors import InputError
from insgnss.geodesy.rotation import rotation_from_vector, vector_from_rotation
from insgnss.photogrammetry.adjust.adjustment import adjust_problem
from insgnss.photogrammetry.adjust.aerial import (
    AERIAL_PARAMETERS,
    BORESIGHT,
    CAMERA_LEVER_ARM,
    COMMON_OF_TRAJECTORY,
    EXPOSURE_DELAY,
    LINE_DRIFT,
    SHIFT,
    AerialControl,
    CorrelatedShifts,
    ParameterObservation,
    chained_covariance,
    slow_errors,
)
from insgnss.photogrammetry.adjust.groups import weight_of
from insgnss.photogrammetry.adjust.normals import problem_of
from insgnss.photogrammetry.adjust.precision import precision_of
from insgnss.records import ExteriorOrientation
from insgnss.records.block import INTERIOR

LEVER = np.array([0.46, 0.02, -0.07])
TURN = np.array([0.004, -0.006, 0.01])
OFFSET = np.array([0.003])


def flight(made, rng):
    """Stamps, velocities and rates of the images of two strips."""
    n = len(made.block.images)
    time = 100.0 + 2.0 * np.arange(n)
    velocity = np.tile([15.0, 0.0, 0.0], (n, 1)) * np.where(np.arange(n) < n // 2, 1, -1)[:, None]
    return time, velocity + rng.normal(0.0, 1.0, (n, 3)), rng.normal(0.0, 0.05, (n, 3))


def strip_covariance(n, dt=2.0):
    """A constant with a wandering part, positions (5 cm) and attitudes (0.01 deg)."""
    gap = np.abs(np.subtract.outer(np.arange(n), np.arange(n))) * dt
    in_time = 0.8 * np.exp(-gap / 60.0) + 0.2 * np.eye(n)
    sigma = np.array([0.05] * 3 + [np.radians(0.01)] * 3)
    return np.kron(in_time, np.diag(sigma**2))


def observed(made, rng, cov, blocks, strip_of):
    """(J.8) and (J.9) of the true poses, with errors of `cov` for each strip."""
    time, velocity, rate = flight(made, rng)
    E, lever, d = (
        blocks[(BORESIGHT, 0)],
        blocks[(CAMERA_LEVER_ARM, 0)],
        blocks[(EXPOSURE_DELAY, 0)][0],
    )
    groups = []
    for strip in range(2):
        rows = np.flatnonzero(strip_of == strip)
        errors = (lower_factor(cov) @ rng.normal(size=6 * rows.size)).reshape(-1, 6)
        X, C = made.truth.position[rows], made.truth.C_mc[rows]
        since = time[rows] - time[rows].mean()
        X = X + C @ lever - d * velocity[rows] + blocks[(SHIFT, strip)]
        X = X + since[:, None] * blocks[(LINE_DRIFT, strip)] - errors[:, :3]
        C = rotation_from_vector(-d * rate[rows]) @ C @ E.T
        C = rotation_from_vector(-errors[:, 3:]) @ C
        parameters = {
            CAMERA_LEVER_ARM: 0,
            BORESIGHT: 0,
            EXPOSURE_DELAY: 0,
            SHIFT: strip,
            LINE_DRIFT: strip,
        }
        groups.append(
            AerialControl(
                tuple(int(i) for i in rows),
                X,
                C,
                weight_of(cov, "strip"),
                time[rows],
                velocity[rows],
                rate[rows],
                parameters,
            )
        )
    return groups


def true_blocks(rng):
    blocks = {(CAMERA_LEVER_ARM, 0): LEVER, (BORESIGHT, 0): rotation_from_vector(TURN)}
    blocks[(EXPOSURE_DELAY, 0)] = OFFSET
    for strip in range(2):
        blocks[(SHIFT, strip)] = rng.normal(0.0, 0.1, 3)
        blocks[(LINE_DRIFT, strip)] = rng.normal(0.0, 0.002, 3)
    return blocks


@pytest.fixture(scope="module")
def small():
    made = simulated(41, strips=2, images=4, points=60, cameras=(camera(free=()),))
    rng = np.random.default_rng(42)
    blocks = true_blocks(rng)
    strip_of = np.arange(8) // 4
    groups = observed(made, rng, strip_covariance(4), blocks, strip_of)
    return made, blocks, groups


SHARED = np.zeros((8, 6, 2))
"""A tilt of the body, of strips with opposite headings; a shift with a turn of the heading."""
SHARED[:, 3, 0] = np.repeat([5e-4, -5e-4], 4)
SHARED[:, 4, 0] = np.repeat([3e-4, -3e-4], 4)
SHARED[:, :3, 1] = [0.03, -0.02, 0.01]
SHARED[:, 5, 1] = 1e-4


def with_common(groups, blocks):
    """The same with common errors of the two strips."""
    halves = SHARED.reshape(2, 4, 6, 2)
    groups = [
        replace(g, parameters={**g.parameters, COMMON_OF_TRAJECTORY: 0}, common=A)
        for g, A in zip(groups, halves, strict=True)
    ]
    return groups, blocks | {(COMMON_OF_TRAJECTORY, 0): np.array([0.7, -1.2])}


def test_derivatives(small) -> None:
    """Oracle: central differences through `Unknowns.moved`, far from the observed poses."""
    made, blocks, groups = small
    groups, blocks = with_common(groups, blocks)
    problem = problem_of(made.block, groups, blocks)
    turned = rotation_from_vector(np.array([0.2, -0.3, 0.4])) @ made.truth.C_mc
    values = replace(made.truth, blocks=blocks, C_mc=turned)
    group = groups[1]
    _, J = group.linearised(values)
    columns = np.concatenate([problem.layout.of(key)[0] for key in group.keys])
    assert len(columns) == J.shape[1] == 24 + 13 + 2
    dp = np.zeros_like(values.point)
    for k, column in enumerate(columns):
        step = 1e-6 * np.eye(problem.layout.size)[column]
        ahead, behind = (
            group.linearised(values.moved(problem.layout, s, dp))[0] for s in (step, -step)
        )
        assert J[:, k] == pytest.approx(-(ahead - behind) / 2e-6, abs=1e-6)


def test_positions_alone(small) -> None:
    """Oracle: the rows of the position in the whole group."""
    made, blocks, groups = small
    values = replace(made.truth, blocks=blocks)
    e, J = groups[0].linearised(values)
    alone = replace(groups[0], weight=np.eye(12))
    got_e, got_J = alone.linearised(values)
    rows = np.arange(24).reshape(4, 6)[:, :3].ravel()
    assert got_e.tolist() == e[rows].tolist()
    assert got_J.tolist() == J[rows].tolist()


def test_common_errors_are_the_covariance_between_strips(small) -> None:
    """Oracle: both strips as one group whose covariance has A A^T between them: the same poses,
    bore-sight and covariances; of independent strips the sigma of the bore-sight is too small.
    """
    made, blocks, _ = small
    rest = strip_covariance(4)
    whole = np.kron(np.eye(2), rest) + SHARED.reshape(48, 2) @ SHARED.reshape(48, 2).T
    mounting = {(BORESIGHT, 0): np.eye(3)}
    keys = [(BORESIGHT, 0), ("pose", 0), ("pose", 7)]

    def solution(observations, values):
        problem = problem_of(made.block, observations, values)
        result = adjust_problem(problem, replace(made.truth, blocks=values))
        return result.values, precision_of(result, 1.0).cov(*keys)

    n = np.arange(8)
    X = made.truth.position
    rng = np.random.default_rng(5)
    C = made.truth.C_mc @ blocks[(BORESIGHT, 0)].T
    e = SHARED @ np.array([1.0, -0.5]) + (
        np.kron(np.eye(2), lower_factor(rest)) @ rng.normal(size=48)
    ).reshape(8, 6)
    X, C = X - e[:, :3], rotation_from_vector(-e[:, 3:]) @ C
    still = np.zeros((8, 3))

    def strip(rows, cov, parameters, common=None):
        place = tuple(int(i) for i in rows), X[rows], C[rows], weight_of(cov, "strip")
        motion = 2.0 * rows, still[rows], still[rows]
        return AerialControl(*place, *motion, parameters, common=common)

    one, P_one = solution([strip(n, whole, {BORESIGHT: 0})], mounting)
    both = {BORESIGHT: 0, COMMON_OF_TRAJECTORY: 0}
    strips = [strip(rows, rest, both, SHARED[rows]) for rows in (n[:4], n[4:])]
    prior = ParameterObservation(
        (COMMON_OF_TRAJECTORY, 0), np.zeros(2), np.eye(2), COMMON_OF_TRAJECTORY
    )
    two, P_two = solution([*strips, prior], mounting | {(COMMON_OF_TRAJECTORY, 0): np.zeros(2)})
    sigma = np.sqrt(np.diag(P_one))
    assert np.abs((P_two - P_one) / np.outer(sigma, sigma)).max() < 1e-6
    psi = vector_from_rotation(one.blocks[keys[0]] @ two.blocks[keys[0]].T)
    assert np.abs(psi / sigma[:3]).max() < 1e-4
    assert np.abs((one.position[7] - two.position[7]) / sigma[9:12]).max() < 1e-4
    part = [np.ix_(np.r_[k : k + 24], np.r_[k : k + 24]) for k in (0, 24)]
    alone = [
        strip(rows, whole[own], {BORESIGHT: 0})
        for rows, own in zip((n[:4], n[4:]), part, strict=True)
    ]
    _, P_alone = solution(alone, mounting)
    assert np.sqrt(np.diag(P_alone) / np.diag(P_one))[:2].max() < 0.9


@pytest.mark.slow
def test_mounting_is_found_within_its_covariance() -> None:
    """Oracle: chi-square, 99 %, over twelve blocks: lever arm with bore-sight, time offset and
    strips together, and poses; ground control holds the datum.
    """
    from scipy.stats import chi2

    totals, count = {}, {}
    for seed in range(12):
        made = simulated(
            500 + seed, strips=2, images=4, points=60, cameras=(camera(free=("f", "cx", "cy")),)
        )
        rng = np.random.default_rng([7, seed])
        blocks = true_blocks(rng)
        cov = strip_covariance(4)
        groups = observed(made, rng, cov, blocks, np.arange(8) // 4)
        priors = {
            CAMERA_LEVER_ARM: 0.01,
            BORESIGHT: 0.01,
            EXPOSURE_DELAY: 0.002,
            SHIFT: 0.1,
            LINE_DRIFT: 0.002,
        }
        first, observations = {}, list(groups)
        for key, value in blocks.items():
            sigma = priors[key[0]]
            error = sigma * rng.normal(size=3 if value.ndim == 2 else value.size)
            if value.ndim == 2:
                first[key] = rotation_from_vector(-error) @ value
            else:
                first[key] = value - error
            P = np.eye(error.size) / sigma**2
            observations.append(ParameterObservation(key, first[key], P, key[0]))
        from insgnss.photogrammetry.adjust.groups import control_points

        observations += control_points(made.block.control)
        problem = problem_of(made.block, observations, first)
        result = adjust_problem(problem, replace(made.truth, blocks=first))
        precision = precision_of(result, 1.0)
        e = []
        for key, value in blocks.items():
            found = result.values.blocks[key]
            e.append(vector_from_rotation(value @ found.T) if value.ndim == 2 else value - found)
        cases = {"blocks": (np.concatenate(e), list(blocks))}
        psi = vector_from_rotation(made.truth.C_mc @ result.values.C_mc.swapaxes(1, 2))
        poses = np.hstack([made.truth.position - result.values.position, psi]).ravel()
        cases["poses"] = (poses, [("pose", i) for i in range(8)])
        rows = [INTERIOR.index(name) for name in ("f", "cx", "cy")]
        interior = (made.truth.interior - result.values.interior)[0, rows]
        cases["camera"] = (interior, [("camera", 0)])
        for name, (error, keys) in cases.items():
            nees = error @ np.linalg.solve(precision.cov(*keys), error)
            totals[name] = totals.get(name, 0.0) + nees
            count[name] = count.get(name, 0) + error.size
    for name, total in totals.items():
        low, high = chi2.ppf((0.005, 0.995), count[name])
        assert low < total < high, name


def test_a_parameter_that_is_none_is_refused(small) -> None:
    """Oracle: the list of parameters."""
    with pytest.raises(InputError, match="tilt is none of lever arm, bore-sight"):
        replace(small[2][0], parameters={"tilt": 0})
    with pytest.raises(InputError, match="weight: shape"):
        replace(small[2][0], weight=np.eye(5))
    assert len(AERIAL_PARAMETERS) == 6
    with pytest.raises(InputError, match="common: shape None"):
        replace(small[2][0], parameters={COMMON_OF_TRAJECTORY: 0})
    with pytest.raises(InputError, match=r"common: shape \(3, 6\)"):
        replace(small[2][0], parameters={COMMON_OF_TRAJECTORY: 0}, common=np.zeros((3, 6, 2)))


def test_covariance_of_a_chain() -> None:
    """Oracle: a first-order Gauss-Markov process, a Markov chain, whose covariance is known."""
    n, tau = 6, 30.0
    gap = np.abs(np.subtract.outer(np.arange(n), np.arange(n))) * 2.0
    sigma = np.array([0.05, 0.04, 0.08, 1e-4, 2e-4, 3e-4])
    whole = np.kron(np.exp(-gap / tau), np.diag(sigma**2))
    blocks = whole.reshape(n, 6, n, 6).transpose(0, 2, 1, 3)
    eo = ExteriorOrientation(
        tuple("abcdef"),
        np.arange(n, dtype=float),
        2000,
        np.zeros(3),
        np.zeros((n, 3)),
        np.tile(np.eye(3), (n, 1, 1)),
        blocks[np.arange(n), np.arange(n)],
        blocks[np.arange(n - 1), np.arange(1, n)],
        np.eye(3),
        np.eye(3),
    )
    assert chained_covariance(eo) == pytest.approx(whole, rel=1e-12, abs=1e-20)
    with pytest.raises(InputError, match="covariance between neighbours is not known"):
        chained_covariance(replace(eo, cross=None))


def test_slow_errors_of_lines_are_those_of_the_whole_process() -> None:
    """Oracle: the covariance of a Gauss-Markov process at all stamps. Exact within a line; of two
    lines r_ic r_cd r_dj stands for r_ij, too small by the way from i and j to their middles and
    back, D together: by 1 - exp(-2 D / T) of the variance at most."""
    time = [100.0 + np.arange(0.0, 24.0, 2.0), 150.0 + np.arange(0.0, 24.0, 2.0)]
    sigma, T = np.array([0.02, 0.02, 0.03]), 300.0
    shifts, within = slow_errors(time, sigma, T)
    whole = np.concatenate(time)
    exact = np.kron(np.exp(-np.abs(whole[:, None] - whole) / T), np.diag(sigma**2))
    middle = np.repeat([t.mean() for t in time], 12)
    of_line = np.repeat(np.eye(2), 12, axis=0)
    H = np.kron(of_line * np.exp(-np.abs(whole - middle) / T)[:, None], np.eye(3))
    assembled = H @ shifts @ H.T + block_diag(*within)
    for k in range(2):
        rows = np.s_[36 * k : 36 * k + 36]
        assert_allclose(assembled[rows, rows], exact[rows, rows], atol=1e-15)
    most = 1.0 - np.exp(-2.0 * (11.0 + 11.0) / T)
    assert np.abs(assembled - exact).max() < most * sigma[2] ** 2


def test_correlated_shifts_are_estimated_as_generalised_least_squares_has_them() -> None:
    """Oracle: the normal equations with the dense covariance, of shifts observed once each."""
    shifts, _ = slow_errors([np.array([0.0]), np.array([50.0])], np.full(3, 0.02), 300.0)
    keys = ((SHIFT, 0), (SHIFT, 1))
    group = CorrelatedShifts(keys, shifts)
    value = {keys[0]: np.array([0.01, 0.0, 0.02]), keys[1]: np.zeros(3)}
    e, J = group.linearised(SimpleNamespace(blocks=value))
    assert_allclose(e, -np.r_[value[keys[0]], 0.0, 0.0, 0.0])
    R = 1e-4 * np.eye(6)
    z = np.r_[0.03, 0.0, 0.0, 0.0, 0.01, 0.0]
    x = np.linalg.solve(J.T @ group.weight @ J + np.linalg.inv(R), np.linalg.solve(R, z))
    assert_allclose(x, shifts @ np.linalg.solve(shifts + R, z), rtol=1e-10)
