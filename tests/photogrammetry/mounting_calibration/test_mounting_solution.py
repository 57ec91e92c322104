"""Lever arms, bore-sight and delay from poses: exact values, covariances, verdicts."""

from dataclasses import replace

import numpy as np
import pytest
from posed_flights import (
    ANTENNA,
    DELAY_S,
    IMU,
    LEVER_SIGMA_M,
    ONE_HEADING,
    PLAIN,
    Plan,
    only,
    posed,
)
from scipy.stats import chi2

from insgnss.geodesy.rotation import (
    rotation_from_opk,
    rotation_from_vector,
    vector_from_rotation,
)
from insgnss.photogrammetry.adjust.aerial import BORESIGHT, CAMERA_LEVER_ARM, EXPOSURE_DELAY
from insgnss.photogrammetry.mounting_calibration.block_errors import shared_covariance
from insgnss.photogrammetry.mounting_calibration.equations import (
    BLOCK_SCALE,
    TRANSLATION,
    Assumptions,
)
from insgnss.photogrammetry.mounting_calibration.judgement import (
    CONTRADICTING,
    DETERMINED,
    UNDETERMINED,
    components,
    misread_boresight,
)
from insgnss.photogrammetry.mounting_calibration.records import Stated
from insgnss.photogrammetry.mounting_calibration.solution import solve
from insgnss.records.strips import CommonErrors

KNOWN = Assumptions(lever_arm_sigma_m=LEVER_SIGMA_M)


def solved(of, **known):
    return solve(of.block, of.flight, of.rows, replace(KNOWN, **known))


def errors(of, result):
    """True minus found (beta, antenna, imu, delay) and its covariance."""
    E = of.flight.mounting.C_cb @ of.mounting.C_cb.T
    beta = vector_from_rotation(E @ result.boresight_change.T)
    antenna, imu = result.lever_arms()
    J = np.zeros((10, len(result.cov)))
    J[:3, result.place[BORESIGHT]] = np.eye(3)
    J[3:9] = result.lever_arm_derivatives()
    J[9:, result.place[EXPOSURE_DELAY]] = 1.0
    delay = DELAY_S - result.values[EXPOSURE_DELAY]
    e = np.concatenate([beta, ANTENNA - antenna, IMU - imu, delay])
    return e, J @ result.cov @ J.T


@pytest.mark.parametrize("georeferenced", [True, False])
def test_without_errors_the_mounting_comes_out(georeferenced) -> None:
    """Oracle: the mounting that the poses were made with; what is left is the prior of 0.3 m."""
    of = posed(noise=0.0, georeferenced=georeferenced)
    e, _ = errors(of, solved(of))
    assert np.degrees(np.abs(e[:3]).max()) < 2e-4
    assert np.abs(e[3:5]).max() < 1e-4  # forward and right; a tilt of 3 deg tells less of down
    assert abs(e[5]) < 2e-3
    assert abs(e[9]) < 1e-5


def test_errors_have_the_covariance_that_is_told() -> None:
    """Oracle: chi-square over 24 flights, bore-sight, antenna and delay jointly, 99.9 %."""
    squares, flights = [], 24
    own = [0, 1, 2, 3, 4, 5, 9]
    for seed in range(flights):
        of = posed(seed=seed, georeferenced=bool(seed % 2))
        e, P = errors(of, solved(of))
        squares.append(e[own] @ np.linalg.solve(P[np.ix_(own, own)], e[own]))
    low, high = chi2.ppf((5e-4, 1 - 5e-4), 7 * flights) / (7 * flights)
    assert low < np.mean(squares) / 7.0 < high


@pytest.mark.slow
def test_images_weighed_alone_make_the_bore_sight_seem_better_than_it_is() -> None:
    """Why the whole covariance weighs: tilts that all images share do not average out.

    Oracle: chi-square of 10 flights; alone its bound is left behind by far.
    """
    alone, whole, flights = 0.0, 0.0, 10
    for seed in range(flights):
        of = posed(seed=100 + seed)
        n = of.rows.size
        none = CommonErrors(np.zeros(n, dtype=np.int64), np.zeros((n, 6, 3)))
        single = replace(of, flight=replace(of.flight, lines=(), common=none))
        for flight in (of, single):
            e, P = errors(flight, solved(flight))
            square = e[:2] @ np.linalg.solve(P[:2, :2], e[:2])
            whole, alone = (whole + square, alone) if flight is of else (whole, alone + square)
    bound = chi2.ppf(0.999, 2 * flights)
    assert whole < bound
    assert alone > 2.0 * bound


def test_whole_covariance_is_that_of_images_where_they_are_independent() -> None:
    """Oracle: the other path through the adjustment, without the bending that it has not."""
    of = posed(seed=3)
    few = only(of, np.arange(0, 60, 3))  # too few images for a bending
    n = few.rows.size
    whole = np.zeros((n, 6, n, 6))
    whole[np.arange(n), :, np.arange(n)] = few.block.cov
    joint = replace(few, block=replace(few.block, cov=whole.reshape(6 * n, 6 * n)))
    (e, P), (e_joint, P_joint) = errors(few, solved(few)), errors(joint, solved(joint))
    np.testing.assert_allclose(e_joint, e, atol=1e-3 * np.sqrt(np.diag(P)).min())
    np.testing.assert_allclose(P_joint, P, rtol=1e-3, atol=1e-4 * np.diag(P).max())


def test_bending_of_a_block_is_no_mounting() -> None:
    """Oracle: the same block straight; sag of 8 cm at the rim, of which polynomials take all."""
    of = posed(seed=5)
    X = of.block.position
    r2 = ((X[:, :2] - X[:, :2].mean(axis=0)) ** 2).sum(axis=1) / 150.0**2
    bent = X + np.outer(r2, [0.0, 0.05, 0.08])
    e, P = errors(of, solved(of))
    e_bent, P_bent = errors(of, solved(replace(of, block=replace(of.block, position=bent))))
    sigma = np.sqrt(np.diag(P))
    assert (np.abs(e_bent - e) < 0.2 * sigma).all()
    np.testing.assert_allclose(np.sqrt(np.diag(P_bent)), sigma, rtol=0.1)


@pytest.mark.parametrize("stated", [True, False])
def test_what_the_camera_of_the_block_moves_is_no_lever_arm(stated) -> None:
    """A principal point 1 px off moves poses by 2 cm in camera axes, as a lever arm does.

    Oracle: the true lever arm; without (L.6) 10 sigma away.
    """
    of = posed(seed=5)
    block = of.block
    moved = block.position + block.C_rc @ [0.02, -0.01, 0.1]
    cov = np.array(block.cov)
    cov[:, :3, :3] = np.diag([0.02, 0.02, 0.1]) ** 2
    of = replace(of, block=replace(block, position=moved, cov=cov if stated else None, shared=None))
    result = solved(of)
    e, P = errors(of, result)
    assert (np.abs(e) < 3.0 * np.sqrt(np.diag(P))).all()
    judged = {c.name: c for c in components(result, of.stated)}
    right = judged["antenna lever arm y (left)"]
    assert right.verdict == UNDETERMINED
    assert "x by the block's camera" in right.why or "y by the block's camera" in right.why
    assert any("--pose-sigma" in remedy for remedy in right.remedies)
    assert judged["camera delay"].determined
    independent = replace(of, block=replace(of.block, shared=np.zeros((6, 6))))
    e, P = errors(independent, solved(independent))
    assert np.abs(e[3:5] / np.sqrt(np.diag(P))[3:5]).max() > 5.0


def test_poses_without_covariance_get_it_from_their_residuals() -> None:
    """Oracle: what they were made with, 10 mm and 0.003 deg; 300 values tell it to 15 %."""
    of = posed(seed=7)
    result = solved(replace(of, block=replace(of.block, cov=None)))
    assert set(result.factors) == {"positions", "attitudes"}
    position = 0.02 * np.sqrt(result.factors["positions"])
    assert position == pytest.approx(0.010, rel=0.3)
    e, P = errors(of, result)
    assert (np.abs(e) < 4.0 * np.sqrt(np.diag(P))).all()


def test_one_heading_at_one_speed_gives_no_lever_arm_and_no_delay() -> None:
    of = posed(ONE_HEADING, seed=2)
    judged = {c.name: c for c in components(solved(of), of.stated)}
    for name, c in judged.items():
        if "arm" in name or "delay" in name:
            assert c.verdict == UNDETERMINED, name
            assert c.text.startswith("sigma")
    delay = judged["camera delay"]
    assert "speed was 1" in delay.why
    forward = judged["antenna lever arm x (backward)"]
    assert "camera delay" in forward.why
    assert "speed was 1" in forward.why
    assert judged["bore-sight about z"].determined


def test_what_is_advised_helps() -> None:
    """Oracle: the flight with the line that is advised, flown and adjusted."""
    of = posed(ONE_HEADING, seed=2)
    judged = {c.name: c for c in components(solved(of), of.stated)}
    right = judged["antenna lever arm y (left)"]
    opposite = next(r for r in right.remedies if "opposite direction would" in r)
    told = float(opposite.split()[-2])
    plan = Plan((10.0,) * 4 + (190.0,), (15.0,) * 5, 12, 0.5, 0.0, 0.05)
    more = posed(plan, seed=2)
    again = {c.name: c for c in components(solved(more), more.stated)}
    flown = 1e3 * again["antenna lever arm y (left)"].sigma
    assert right.sigma > 0.05
    assert told == pytest.approx(flown, rel=0.4)


def test_a_slower_line_tells_delay_from_lever_arm() -> None:
    """Two directions at one speed do not tell them apart; the advice is the slower line."""
    level = Plan((10.0, 190.0, 10.0, 190.0), (15.0,) * 4, 12, 0.5, 0.0, 0.05)
    of = posed(level, seed=4)
    judged = {c.name: c for c in components(solved(of), of.stated)}
    delay = judged["camera delay"]
    assert delay.verdict == UNDETERMINED
    assert "antenna lever arm x (backward)" in delay.why
    forward = judged["antenna lever arm x (backward)"]
    assert "camera delay" in forward.why
    assert any("70 % of the speed" in remedy for remedy in forward.remedies)
    slower = posed(replace(level, speeds=(15.0, 15.0, 10.0, 10.0)), seed=4)
    again = {c.name: c for c in components(solved(slower), slower.stated)}
    assert again["camera delay"].verdict == DETERMINED


def test_what_the_flight_file_does_not_state_is_not_held() -> None:
    """A lever arm that nobody stated, or one far off, stays out; a stated one near by stands in."""
    of = posed(ONE_HEADING, seed=2)
    result = solved(of)
    stated = {c.name: c for c in components(result, of.stated)}
    assert stated["antenna lever arm y (left)"].held
    nobody = components(result, replace(of.stated, keys=frozenset()))
    assert not [c.name for c in nobody if c.held]
    far = replace(of.stated.mounting, antenna_m=np.array([9.0, -9.0, 9.0]))
    judged = components(result, replace(of.stated, mounting=far))
    lever = [c for c in judged if c.group == "antenna_m"]
    assert not any(c.held for c in lever)
    assert all(c.against and c.verdict == UNDETERMINED for c in lever)


def test_errors_beyond_their_covariance_enlarge_it() -> None:
    """Poses that claim a hundredth of their errors: the factor, and the true values within it."""
    of = posed(seed=12)
    claimed = replace(of, block=replace(of.block, cov=1e-4 * of.block.cov))
    result = solved(claimed)
    e, P = errors(of, result)
    assert (np.abs(e) < 4.0 * np.sqrt(np.diag(P))).all()


def test_a_flight_worse_than_it_claims_enlarges_the_sigmas() -> None:
    """Oracle: chi-square of three flights, bore-sight, antenna and delay jointly, 99.9 %. Errors
    that last along a line are six times what the flight claims, and no block's poses have such.
    """
    sizes, own = np.repeat([0.03, np.radians(0.01)], 3), [0, 1, 2, 3, 4, 5, 9]
    square = 0.0
    for seed in range(3):
        of, rng = posed(seed=seed), np.random.default_rng(50 + seed)
        X, C = of.flight.eo.position_m.copy(), of.flight.eo.C_mc.copy()
        lines = []
        for line in of.flight.lines:
            k = np.arange(line.rows.size)
            rho = np.exp(-np.abs(k[:, None] - k) / 60.0)
            error = 6.0 * np.linalg.cholesky(rho) @ (rng.standard_normal((k.size, 6)) * sizes)
            X[line.rows] -= error[:, :3]
            C[line.rows] = rotation_from_vector(-error[:, 3:]) @ C[line.rows]
            lines.append(replace(line, cov=line.cov + np.kron(rho, np.diag(sizes**2))))
        eo = replace(of.flight.eo, position_m=X, C_mc=C)
        result = solved(replace(of, flight=replace(of.flight, eo=eo, lines=tuple(lines))))
        assert result.enlarged > 1.5
        e, P = errors(of, result)
        square += e[own] @ np.linalg.solve(P[np.ix_(own, own)], e[own])
    low, high = chi2.ppf((5e-4, 1 - 5e-4), 7 * 3)
    assert low < square < high


@pytest.mark.parametrize("unit", [1.0, 0.03, 1000.0])
def test_what_all_images_share_in_camera_axes_is_in_metres(unit) -> None:
    """Oracle: poses off by 2, 3, 9 cm and 10, 20, 30 urad of each camera's axes, in a block whose
    unit is another; 0.1 mm and 0.1 urad beside them are the floor.
    """
    block = posed(seed=4).block
    sizes = np.array([0.02, 0.03, 0.09, 1e-5, 2e-5, 3e-5])
    J = np.zeros((len(block.images), 6, 6))
    J[:, :3, :3], J[:, 3:, 3:] = unit * block.C_rc, block.C_rc
    cov = J @ np.diag(sizes**2) @ J.swapaxes(1, 2)
    S = shared_covariance(replace(block, cov=cov, shared=None), 1.0 / unit, (0.0, 0.0))
    expected = np.diag(sizes**2 + np.repeat([1e-4**2, 1e-7**2], 3))
    np.testing.assert_allclose(S, expected, rtol=1e-9, atol=1e-17)


def test_ground_control_determines_the_vertical_lever_arm() -> None:
    of = posed(seed=6)
    free = {c.name: c for c in components(solved(of), of.stated)}
    held = {c.name: c for c in components(solved(of, shift_sigma_m=0.002), of.stated)}
    name = "antenna lever arm z (down)"
    assert held[name].sigma < 0.6 * free[name].sigma
    assert held[name].determined


def test_a_flight_file_that_is_wrong_is_contradicted() -> None:
    of = posed(seed=8)
    keys = frozenset({"antenna_m", "boresight", "delay"})
    judged = {c.name: c for c in components(solved(of), replace(of.stated, keys=keys))}
    assert judged["antenna lever arm x (backward)"].verdict == CONTRADICTING
    assert judged["camera delay"].verdict == CONTRADICTING
    assert "sigma" in judged["camera delay"].why
    right = replace(of.stated, mounting=of.mounting, delay_s=DELAY_S, keys=keys)
    fine = components(solved(of), right)
    assert not [c.name for c in fine if c.verdict == CONTRADICTING]


@pytest.mark.parametrize(
    ("angles", "words"),
    [
        ([-0.657, 0.574, -0.513], "phi with the other sign"),
        ([0.657, 0.574, -0.513], "omega and phi with the other sign"),
    ],
)
def test_a_bore_sight_with_a_wrong_sign_is_named(angles, words) -> None:
    """Oracle: the sign that was changed."""
    of = posed(seed=9)
    true = rotation_from_opk(np.radians([-0.657, -0.574, -0.513]))
    own = replace(of.flight.mounting, boresight=rotation_from_opk(np.radians(angles)))
    stated = Stated(own, 0.0, frozenset({"boresight"}))
    judged = [
        replace(c, verdict=CONTRADICTING)
        for c in components(solved(of), of.stated)
        if c.group == "boresight"
    ]
    assert words in str(misread_boresight(stated, judged, true))
    assert misread_boresight(stated, judged, rotation_from_opk(np.array([0.3, 0.2, 0.1]))) is None


def test_the_frame_of_a_block_comes_out() -> None:
    """Oracle: scale and shift of the simulated frame."""
    of = posed(PLAIN, seed=1, georeferenced=False)
    result = solved(of)
    assert result.values[BLOCK_SCALE][0] * 0.03 == pytest.approx(1.0, abs=5 * 0.03 * 1e-3)
    near = posed(PLAIN, seed=1)
    moved = replace(near.block, position=near.block.position + [1.0, -2.0, 3.0])
    shift = solved(replace(near, block=moved)).values[TRANSLATION] - moved.position.mean(axis=0)
    before = solved(near).values[TRANSLATION] - near.block.position.mean(axis=0)
    np.testing.assert_allclose(shift - before, [-1.0, 2.0, -3.0], atol=1e-6)
    assert CAMERA_LEVER_ARM in result.place
