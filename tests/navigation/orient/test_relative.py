"""Relative control: its values, the covariances that it hands on, and which images make a pair."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from draws import normal_draws
from numpy.testing import assert_allclose
from oracles import oracle
from scipy.spatial.transform import Rotation

from insgnss.base.errors import UsageError
from insgnss.geodesy.rotation import rotation_from_vector, skew, vector_from_rotation
from insgnss.navigation.orient.frame import in_frame
from insgnss.navigation.orient.relative import (
    GAP_S,
    GyroFigures,
    _pairs,
    _turn,
    gyro_figures,
    line_pairs,
    relative_control,
)
from insgnss.records import ExteriorOrientation, FramedOrientation

GYRO = GyroFigures(noise=5e-5, drift=2e-4)
NADIR = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


def block(n: int = 6, step_s: float = 2.0, seed: int = 5) -> ExteriorOrientation:
    """A straight line eastwards of images that look down, with errors that neighbours share."""
    rng = np.random.default_rng(seed)
    # one joint covariance of all images, its blocks cut out of it
    A = (
        rng.standard_normal((6 * n, 6 * n + 3))
        * np.tile([0.02, 0.02, 0.03, 1e-3, 1e-3, 3e-3], n)[:, None]
        * 0.2
    )
    shared = np.tile(np.diag([0.02, 0.02, 0.03, 1e-3, 1e-3, 3e-3]), (n, 1))
    P = A @ A.T + shared @ shared.T
    cov = np.stack([P[6 * k : 6 * k + 6, 6 * k : 6 * k + 6] for k in range(n)])
    cross = np.stack([P[6 * k : 6 * k + 6, 6 * k + 6 : 6 * k + 12] for k in range(n - 1)])
    C_mc = rotation_from_vector(0.05 * rng.standard_normal((n, 3))) @ NADIR
    position = np.column_stack(
        [30.0 * np.arange(n), rng.standard_normal(n), 120.0 + rng.standard_normal(n)]
    )
    origin = np.array([np.radians(46.57), np.radians(6.54), 500.0])
    names = tuple(f"{k}.tif" for k in range(n))
    return ExteriorOrientation(
        names, step_s * np.arange(n), 2008, origin, position, C_mc, cov, cross, np.eye(3), np.eye(3)
    )


def framed(eo: ExteriorOrientation) -> FramedOrientation:
    return in_frame(eo, "tangent plane")


@pytest.mark.parametrize("form", ["mapping", "camera"])
def test_covariance_is_that_of_perturbed_pairs(form: str) -> None:
    """Oracle: Monte Carlo, both images of a pair moved by draws of their joint covariance, with
    finite rotations.
    """
    eo = block()
    found = relative_control(framed(eo), GYRO, form)  # type: ignore[arg-type]
    k = 2
    joint = np.block([[eo.cov[k], eo.cross[k]], [eo.cross[k].T, eo.cov[k + 1]]])
    e = normal_draws(joint, 4000, seed=2)
    X_i, X_j = eo.position_m[k] + e[:, :3], eo.position_m[k + 1] + e[:, 6:9]
    C_i, C_j = (
        Rotation.from_rotvec(e[:, 6 * s + 3 : 6 * s + 6]).as_matrix() @ eo.C_mc[k + s]
        for s in (0, 1)
    )
    if form == "mapping":
        offset, rotation = X_j - X_i, C_j @ C_i.swapaxes(1, 2)
    else:
        offset, rotation = np.einsum("nij,ni->nj", C_i, X_j - X_i), C_i.swapaxes(1, 2) @ C_j
    psi = Rotation.from_matrix(rotation @ found.rotation[k].T).as_rotvec()
    sampled = np.cov(np.hstack([offset - found.offset[k], psi]).T)
    scale = np.sqrt(np.diag(sampled))
    assert_allclose(
        found.smoothed[k] / np.outer(scale, scale), sampled / np.outer(scale, scale), atol=0.003
    )


@pytest.mark.parametrize("form", ["mapping", "camera"])
def test_errors_of_a_pair_are_its_jacobians_times_those_of_the_images(form: str) -> None:
    """Oracle: a rank-one covariance, whose relative error is known from two finite poses."""
    eo = block(2)
    e = 1e-6 * np.random.default_rng(8).standard_normal(12)
    eo = replace(
        eo,
        cov=np.stack([np.outer(e[:6], e[:6]), np.outer(e[6:], e[6:])]),
        cross=np.outer(e[:6], e[6:])[None],
    )
    moved = replace(
        eo,
        position_m=eo.position_m + e.reshape(2, 6)[:, :3],
        C_mc=rotation_from_vector(e.reshape(2, 6)[:, 3:]) @ eo.C_mc,
    )
    found, true = (relative_control(framed(x), GYRO, form) for x in (eo, moved))  # type: ignore[arg-type]
    psi = vector_from_rotation(true.rotation[0] @ found.rotation[0].T)
    error = np.concatenate([true.offset[0] - found.offset[0], psi])
    assert_allclose(
        found.smoothed[0], np.outer(error, error), atol=2e-5 * np.abs(np.outer(error, error)).max()
    )


def test_smoothed_covariance_is_nil_where_all_images_share_their_error() -> None:
    """Oracle: equation 3, S cancels; a common shift and a common turn leave the offset in the
    camera form alone.
    """
    eo = block()
    shift = np.zeros((6, 6))
    shift[:3, :3] = np.diag([0.1, 0.2, 0.3]) ** 2
    same = replace(
        eo, cov=np.broadcast_to(shift, eo.cov.shape), cross=np.broadcast_to(shift, eo.cross.shape)
    )
    found = relative_control(framed(same), GYRO)
    assert_allclose(found.smoothed, 0.0, atol=1e-15)
    assert_allclose(found.independent[:, :3, :3], np.broadcast_to(2.0 * shift[:3, :3], (5, 3, 3)))
    turn = np.zeros((6, 6))
    turn[5, 5] = 1e-6
    turned = replace(
        eo, cov=np.broadcast_to(turn, eo.cov.shape), cross=np.broadcast_to(turn, eo.cross.shape)
    )
    assert_allclose(
        relative_control(framed(turned), GYRO, "camera").smoothed[:, 3:, 3:], 0.0, atol=1e-18
    )


def test_mapping_form_does_not_know_the_bore_sight() -> None:
    """Oracle: equation 4; the camera form does know it."""
    eo = block()
    B = rotation_from_vector(np.radians([0.7, -0.6, 0.5]))
    other = replace(eo, C_mc=eo.C_mc @ B)
    for form, same in (("mapping", True), ("camera", False)):
        a, b = (relative_control(framed(x), GYRO, form) for x in (eo, other))  # type: ignore[arg-type]
        assert np.allclose(a.rotation, b.rotation, atol=1e-12) is same
        assert np.allclose(a.smoothed, b.smoothed, atol=1e-12) is same
        assert np.allclose(a.offset, b.offset, atol=1e-9) is same


def test_camera_form_is_the_product_of_poses() -> None:
    """Oracle: 4 x 4 matrices, T_i^-1 T_j."""
    eo = block()
    found = relative_control(framed(eo), GYRO, "camera")
    T = np.tile(np.eye(4), (len(eo.images), 1, 1))
    T[:, :3, :3], T[:, :3, 3] = eo.C_mc, eo.position_m
    for k in range(5):
        M = np.linalg.inv(T[k]) @ T[k + 1]
        assert_allclose(found.offset[k], M[:3, 3], rtol=0, atol=1e-9)
        assert_allclose(found.rotation[k], M[:3, :3], rtol=0, atol=1e-12)


def test_equations_5_and_6_of_the_paper() -> None:
    """Oracle: paper 003, worked by hand: sums of variances; (q sqrt(dt))^2 + (b dt)^2, b times 1.5
    for kappa.
    """
    eo = block(step_s=4.0)
    found = relative_control(framed(eo), GYRO)
    variance = np.diagonal(eo.cov, axis1=1, axis2=2)
    assert_allclose(
        np.diagonal(found.independent, axis1=1, axis2=2)[:, :3],
        variance[:-1, :3] + variance[1:, :3],
        rtol=1e-12,
    )
    expected = 25e-10 * 4.0 + 16.0 * 4e-8 * np.array([1.0, 1.0, 2.25])
    assert_allclose(
        found.gyro[:, 3:, 3:], np.broadcast_to(np.diag(expected), (5, 3, 3)), atol=1e-10
    )
    camera = relative_control(framed(eo), GYRO, "camera").gyro[0, 3:, 3:]
    up = eo.C_mc[0].T @ [0.0, 0.0, 1.0]
    assert_allclose(up @ camera @ up, expected[2], rtol=1e-6)


def test_value_does_not_depend_on_the_frame_but_for_its_axes() -> None:
    """Oracle: the geocentric frame is the tangent plane turned."""
    eo = block()
    m, e = (
        relative_control(in_frame(eo, kind), GYRO, "camera")
        for kind in ("tangent plane", "geocentric")
    )
    assert_allclose(m.offset, e.offset, rtol=0, atol=1e-8)
    assert_allclose(m.smoothed, e.smoothed, atol=1e-15)
    assert_allclose(m.gyro, e.gyro, atol=1e-15)


def test_gyro_figures_of_a_model() -> None:
    """Oracle: by hand: root mean square over the axes, root of the sum over the processes."""
    found = gyro_figures(np.array([3e-5, 4e-5, 5e-5]), np.array([[3e-4, 4e-4]] * 3))
    assert found.noise == pytest.approx(np.sqrt(50.0 / 3.0) * 1e-5)
    assert found.drift == pytest.approx(5e-4)
    assert gyro_figures(np.array([1e-5] * 3), np.zeros((3, 0))).drift == 0.0


def legs(
    *ways: tuple[float, float], per_leg: int = 5, step_s: float = 2.0
) -> tuple[np.ndarray, ...]:
    """Time, position, up and C of images along legs of the given steps (east, north), heading along
    the way.
    """
    place, heading, at = [], [], np.zeros(3)
    for east, north in ways:
        for _ in range(per_leg):
            place.append(at.copy())
            heading.append(np.arctan2(north, east))
            at = at + [east, north, 0.0]
    n = len(place)
    C = Rotation.from_rotvec(np.outer(heading, [0.0, 0.0, 1.0])).as_matrix() @ NADIR
    return step_s * np.arange(n), np.array(place), np.broadcast_to([0.0, 0.0, 1.0], (n, 3)), C


def test_pairs_stay_within_a_line() -> None:
    """Oracle: the plan: two legs with a crossing of one image between them."""
    i, line = line_pairs(*legs((30.0, 0.0), (0.0, 40.0), (-30.0, 0.0), per_leg=5))
    # images 0 to 4 head east, but the way 4 -> 5 leads on east: the turn of the camera ends the
    # line
    assert i.tolist() == [0, 1, 2, 3, 5, 6, 7, 8, 10, 11, 12, 13]
    assert line.tolist() == [1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3]


def test_a_camera_that_never_turns_is_told_by_its_way() -> None:
    """Oracle: the plan of a multicopter that flies sideways: the single step across belongs to no
    line.
    """
    time, place, up, C = legs((30.0, 0.0), (-30.0, 0.0), per_leg=4)
    place[4:] += [-30.0, 40.0, 0.0]  # image 4 lies straight north of image 3
    i, line = line_pairs(time, place, up, np.broadcast_to(C[0], C.shape))
    assert i.tolist() == [0, 1, 2, 4, 5, 6]
    assert line.tolist() == [1, 1, 1, 2, 2, 2]


def test_a_copter_that_yaws_on_a_straight_way_flies_one_line() -> None:
    """Oracle: the plan: images on a straight way, whose camera turns by 30 deg to and fro, are one
    line; so is the way back. The step across between both belongs to none.
    """
    time, place, up, C = legs((30.0, 0.0), (-30.0, 0.0), per_leg=10)
    place[10:] += [-30.0, 40.0, 0.0]  # image 10 lies straight north of image 9
    yaw = np.radians(15.0) * (-1.0) ** np.arange(20)
    turned = rotation_from_vector(np.outer(yaw, [0.0, 0.0, 1.0])) @ C[0]
    i, line = line_pairs(time, place, up, turned)
    assert i.tolist() == [*range(9), *range(10, 19)]
    assert line.tolist() == [1] * 9 + [2] * 9


def test_gap_ends_a_line() -> None:
    """Oracle: paper 003: at most 10 s; a pair by itself between two gaps is a line of its own."""
    time, place, up, C = legs((30.0, 0.0), per_leg=6)
    assert GAP_S == 10.0
    late = time + np.where(np.arange(6) > 2, 9.0, 0.0) + np.where(np.arange(6) > 4, 9.0, 0.0)
    i, line = line_pairs(late, place, up, C)
    assert i.tolist() == [0, 1, 3]
    assert line.tolist() == [1, 1, 2]
    assert line_pairs(late, place, up, C, gap_s=11.0)[0].tolist() == [0, 1, 2, 3, 4]


@pytest.mark.parametrize("n", [0, 1])
def test_too_few_images_make_no_pair(n: int) -> None:
    """Oracle: there is none."""
    eo = block(3)
    few = ExteriorOrientation(
        eo.images[:n],
        eo.time[:n],
        2008,
        eo.origin,
        eo.position_m[:n],
        eo.C_mc[:n],
        eo.cov[:n],
        np.zeros((0, 6, 6)),
        np.eye(3),
        np.eye(3),
    )
    assert relative_control(framed(few), GYRO).i.size == 0


def test_refusals() -> None:
    """Oracle: the house rule: one line that says what to do."""
    eo = block()
    with pytest.raises(UsageError, match="form 'body' is unknown; it is one of mapping, camera"):
        relative_control(framed(eo), GYRO, "body")  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="gap 0 s must be positive"):
        relative_control(framed(eo), GYRO, gap_s=0.0)
    with pytest.raises(UsageError, match="needs a Cartesian frame"):
        relative_control(in_frame(eo, "geographic"), GYRO)
    with pytest.raises(UsageError, match="must be positive"):
        GyroFigures(0.0, 1e-4)


def test_camera_form_is_that_of_the_pose_graph() -> None:
    """Oracle: g2o's edges, derived apart from this: the same pose, and the covariance in the axes
    of camera j, half the rotation vector.
    """
    from insgnss.io.formats.orientation.g2o import relative_pose

    eo = block()
    found = relative_control(framed(eo), GYRO, "camera")
    pairs = (found.i, found.j)
    pose, P = relative_pose(framed(eo), pairs, framed(eo).known_cross[found.i], 0.5)
    assert_allclose(found.offset, pose[:, :3], rtol=0, atol=1e-12)
    assert_allclose(found.rotation, Rotation.from_quat(pose[:, 3:]).as_matrix(), rtol=0, atol=1e-12)
    K = np.zeros((5, 6, 6))
    K[:, :3, :3] = found.rotation.swapaxes(1, 2)
    K[:, 3:, 3:] = 0.5 * K[:, :3, :3]
    assert_allclose(K @ found.smoothed @ K.swapaxes(1, 2), P, rtol=1e-9, atol=1e-15)


@pytest.mark.filterwarnings("ignore")
def test_camera_form_feeds_pycolmap() -> None:
    """Oracle: pycolmap's RelativePosePriorCost on perturbed poses: (psi, dr + r x psi), in the axes
    of camera i, rotation first.
    """
    pycolmap, _ = oracle("pycolmap"), oracle("pyceres")
    from pycolmap import cost_functions

    def pose(C: np.ndarray, X: np.ndarray) -> object:
        return pycolmap.Rigid3d(pycolmap.Rotation3d(C.T), -C.T @ X)

    eo = block(2)
    e = 1e-5 * np.random.default_rng(3).standard_normal((2, 6))
    eo = replace(eo, cov=np.stack([np.outer(x, x) for x in e]), cross=np.outer(e[0], e[1])[None])
    found = relative_control(framed(eo), GYRO, "camera")
    prior = pycolmap.Rigid3d(pycolmap.Rotation3d(found.rotation[0]), found.offset[0])
    cost = cost_functions.RelativePosePriorCost(np.eye(6), prior)
    moved = [
        pose(rotation_from_vector(e[k, 3:]) @ eo.C_mc[k], eo.position_m[k] + e[k, :3])
        for k in (0, 1)
    ]
    residual = np.ravel(
        cost.evaluate(*(np.concatenate([p.rotation.quat, p.translation]) for p in moved))[0]
    )
    J = np.block([[np.zeros((3, 3)), np.eye(3)], [np.eye(3), skew(found.offset[0])]])
    expected = np.outer(residual, residual)
    assert_allclose(J @ found.smoothed[0] @ J.T, expected, atol=1e-3 * np.abs(expected).max())


@pytest.mark.parametrize("longer", [1.0, 7.0, 0.2])
@pytest.mark.parametrize(("turn_deg", "one_line"), [(19.0, True), (21.0, False)])
def test_the_way_of_a_line_turns_by_less_than_20_deg(longer, turn_deg, one_line) -> None:
    """Oracle: the angle between two ways, however long they are; climbing does not count."""
    turn = np.radians(turn_deg)
    way = [[30.0, 0.0, 0.0]] * 3 + [
        [30.0 * longer * np.cos(turn), 30.0 * longer * np.sin(turn), 9.0]
    ] * 3
    place = np.vstack([np.zeros(3), np.cumsum(way, axis=0)])
    up, C = np.broadcast_to([0.0, 0.0, 1.0], (7, 3)), np.broadcast_to(NADIR, (7, 3, 3))
    i, line = line_pairs(2.0 * np.arange(7), place, up, C)
    assert i.tolist() == [0, 1, 2, 3, 4, 5]
    assert line.max() == (1 if one_line else 2)


@pytest.mark.parametrize(("step_m", "pairs"), [(0.11, 3), (0.09, 0)])
def test_a_way_of_a_decimetre_has_a_direction(step_m, pairs) -> None:
    """Oracle: the limit on either side, whatever the climb."""
    place = step_m * np.outer(np.arange(4), [1.0, 0.0, 5.0])
    up, C = np.broadcast_to([0.0, 0.0, 1.0], (4, 3)), np.broadcast_to(NADIR, (4, 3, 3))
    assert line_pairs(np.arange(4.0), place, up, C)[0].size == pairs


def test_the_turn_about_the_vertical_is_that_of_the_rotation_between_two_images() -> None:
    """Oracle: scipy's rotations about any vertical; a roll that is held changes nothing."""
    rng = np.random.default_rng(4)
    up = rng.normal(size=3)
    up /= np.linalg.norm(up)
    heading = rng.uniform(-3.0, 3.0, 8)
    C = (Rotation.from_rotvec(np.outer(heading, up)) * Rotation.random(rng=1)).as_matrix()
    expected = (np.diff(heading) + np.pi) % (2.0 * np.pi) - np.pi
    assert_allclose(_turn(C, np.tile(up, (8, 1))), expected, atol=1e-12)


def test_lines_of_a_rig_are_counted_on_from_camera_to_camera() -> None:
    """Oracle: by hand: three lines of the first camera, of the second two."""
    eo = block()
    one = framed(eo)
    time = np.arange(6.0) + np.repeat([0.0, 30.0, 60.0], 2)
    rows, shared = np.arange(6), np.zeros((6, 6, 6))
    other = SimpleNamespace(
        neighbours=((rows, shared), (rows[:4], shared[:4])),
        C_fE=one.C_fE,
        C_fc=one.C_fc,
        time=time,
        coordinates=one.coordinates,
    )
    i, j, line, cross = _pairs(other, 10.0)
    assert i.tolist() == [0, 2, 4, 0, 2]
    assert j.tolist() == [1, 3, 5, 1, 3]
    assert line.tolist() == [1, 2, 3, 4, 5]
    assert cross.shape == (5, 6, 6)
