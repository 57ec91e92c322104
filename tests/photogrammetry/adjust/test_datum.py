"""Blocks without control: minimal datums, free networks, and distances that give the scale."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from simulated_blocks import camera, no_ground, simulated

from insgnss.base.errors import InputError
from insgnss.geodesy.frames import TangentPlane
from insgnss.geodesy.rotation import skew
from insgnss.io.formats.blocks.joined import JoinedBlock
from insgnss.photogrammetry.adjust.adjustment import adjust_problem
from insgnss.photogrammetry.adjust.groups import DistanceObservation, InnerConstraints
from insgnss.photogrammetry.adjust.normals import problem_of
from insgnss.photogrammetry.adjust.precision import precision_of
from insgnss.photogrammetry.adjust.start import first_values
from insgnss.photogrammetry.adjust.unknowns import POINT, POSE
from insgnss.photogrammetry.block_adjustment.placing import (
    in_own_datum,
    in_tangent_plane,
    read_distances,
)


@pytest.fixture(scope="module")
def block():
    """A block of ten images without control, whose first values are those of a program."""
    made = simulated(5, cameras=(camera(free=("f",)),), noise_px=0.01, control=0)
    return replace(made.block, control=no_ground(), check=no_ground())


def in_datum(block, kind, bars=()):
    """The block adjusted in a datum of its own: result, precision, and its inner constraints."""
    union = JoinedBlock(block, None, block.position_m, block.C_mc)
    block, inner = in_own_datum(block, union, kind, bars)
    rays = np.bincount(block.observations.point, minlength=len(block.points))
    keep = np.flatnonzero(rays >= 2).tolist() if kind == "minimal" else ()
    problem = problem_of(block, [*inner, *bars], keep=keep)
    return precision_of(adjust_problem(problem, first_values(block)), 1.0), inner


@pytest.mark.parametrize("kind", ["images", "points"])
def test_a_free_network_is_the_s_transformation_of_any_datum(block, kind) -> None:
    """Oracle: Baarda's S-transformation by numpy, of the covariance of a minimal datum; residuals,
    redundancy and camera are those of the minimal one."""
    free, (inner,) = in_datum(block, kind)
    minimal, _ = in_datum(block, "minimal")
    assert free.result.cost == pytest.approx(minimal.result.cost, rel=1e-6)
    assert free.result.redundancy == minimal.result.redundancy
    assert free.sigma_interior(0)[0] == pytest.approx(minimal.sigma_interior(0)[0], rel=1e-4)
    poses = [(POSE, k) for k in range(len(block.images))]
    points = [key for key in inner.keys if key[0] == POINT]
    keys = [*poses, *points]
    # motions of all coordinates and attitudes that change no observation, at the first values
    middle = inner.first_m.mean(axis=0)
    place = {POSE: minimal.result.values.position, POINT: minimal.result.values.point}
    G, picked = [], []
    for name, row in keys:
        x = place[name][row] - middle
        motion = np.hstack([np.eye(3), -skew(x), x[:, None]])
        if name == POSE:
            motion = np.vstack([motion, np.hstack([np.zeros((3, 3)), np.eye(3), np.zeros((3, 1))])])
        G.append(motion)
        chosen = (name, row) in inner.keys
        picked.append(np.arange(len(motion)) < (3 if chosen else 0))
    G, picked = np.vstack(G), np.concatenate(picked)
    B = np.zeros((7, len(G)))
    B[:, picked] = inner.motions
    S = np.eye(len(G)) - G @ np.linalg.solve(B @ G, B)
    expected = S @ minimal.cov(*keys) @ S.T
    sigma = np.sqrt(np.diagonal(expected))
    got = free.cov(*keys)
    assert_allclose(got / np.outer(sigma, sigma), expected / np.outer(sigma, sigma), atol=5e-4)
    assert np.trace(got[np.ix_(picked, picked)]) < 0.5 * np.trace(
        minimal.cov(*keys)[np.ix_(picked, picked)]
    )


def test_distances_give_the_scale(block) -> None:
    """Oracle: the lengths between adjusted points, planted 1.7 times as long as in the program's
    axes, with the sigma that a bar of 1e-3 of its length leaves."""
    free, _ = in_datum(block, "images")
    X = free.result.values.point
    pairs = [(3, 40), (10, 22)]
    lengths = [1.7 * float(np.linalg.norm(X[a] - X[b])) for a, b in pairs]
    bars = tuple(
        DistanceObservation(pair, d, np.array([[(1e-3 * d) ** -2]]))
        for pair, d in zip(pairs, lengths, strict=True)
    )
    for kind in ("images", "minimal"):
        scaled, inner = in_datum(block, kind, bars)
        Y = scaled.result.values.point
        got = [float(np.linalg.norm(Y[a] - Y[b])) for a, b in pairs]
        assert_allclose(got, lengths, rtol=1e-6)
        assert scaled.result.cost == pytest.approx(free.result.cost, rel=1e-6)
        assert [len(one.motions) for one in inner] == [6] * (kind == "images")


def test_geocentric_poses_are_brought_into_a_tangent_plane() -> None:
    """Oracle: the same poses made geocentric by the plane's own matrices, one of them without."""
    plane = TangentPlane(0.8, 0.1, 300.0)
    X = np.array([[0.0, 50.0, 3.0], [0.0, -50.0, 3.0], [np.nan] * 3])
    C = np.stack([np.diag([1.0, -1.0, -1.0])] * 3)
    union = JoinedBlock(None, None, plane.origin_ecef + X @ plane.C_em.T, plane.C_em @ C)
    notes = []
    with np.errstate(all="raise"):
        got = in_tangent_plane(union, notes)
    assert_allclose(got.position_m[:2], X[:2] - [0.0, 0.0, 3.0], atol=2e-3)
    assert_allclose(got.C_mc[0], C[0], atol=1e-5)
    assert np.isnan(got.position_m[2]).all()
    assert "origin 45.8366236105 5.7295779513 deg 303.00" in notes[0]


def test_tables_of_distances(block, tmp_path) -> None:
    """Oracle: the numbers of the table; a point that is none."""
    path = tmp_path / "bars.csv"
    path.write_text("from,to,distance,sigma\np3,p40,12.5,0.002\n")
    (bar,) = read_distances(path, block)
    assert (bar.points, bar.distance_m) == ((3, 40), 12.5)
    assert bar.weight[0, 0] == pytest.approx(250000.0)
    path.write_text("from,to,distance,sigma\np3,q40,12.5,0.002\n")
    with pytest.raises(InputError, match=r"bars\.csv:2: point 'q40' is measured in no image"):
        read_distances(path, block)
    bare = replace(block, position_m=np.full_like(block.position_m, np.nan))
    with pytest.raises(InputError, match="needs initial poses"):
        in_datum(bare, "images")
    assert isinstance(in_datum(block, "points")[1][0], InnerConstraints)
