"""The independent poses: their formulas, a flight without noise, and defects of the core's way."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from insgnss import load_flight
from insgnss.flight.reference import independent
from insgnss.flight.reference.independent import LIMIT_POSE_SIGMAS, compare_images
from insgnss.flight.reference.poses import (
    Setup,
    gravity,
    image_poses,
    ned_axes,
    rotation_vector,
    turn,
)
from insgnss.flight.reference.verify import _cut_flight
from insgnss.navigation.innovations.pieces import sub_solution
from insgnss.simulation.dataset import write_dataset
from insgnss.simulation.scenario import simulate_flight
from insgnss.simulation.sensors import ImuOptions


def test_turns_are_those_of_another_library() -> None:
    """Oracle: scipy's Rotation."""
    rng = np.random.default_rng(5)
    for scale in (1e-10, 1e-3, 1.0, 3.0):
        v = rng.normal(size=3)
        v *= scale / np.linalg.norm(v)
        C = Rotation.from_rotvec(v).as_matrix()
        np.testing.assert_allclose(turn(v), C, atol=1e-14)
        np.testing.assert_allclose(rotation_vector(C), v, atol=1e-9)


def test_gravity_is_that_of_the_ellipsoid() -> None:
    """Oracle: normal gravity of WGS 84 at equator, 45 deg and pole: 9.7803253, 9.8061992, 9.8321849
    m/s^2, straight down.
    """
    for lat, expected in ((0.0, 9.7803253), (45.0, 9.8061992), (90.0, 9.8321849)):
        B = np.radians(lat)
        N = 6378137.0 / np.sqrt(1.0 - 0.00669437999014 * np.sin(B) ** 2)
        r = np.array([N * np.cos(B), 0.0, N * (1.0 - 0.00669437999014) * np.sin(B)])
        g = ned_axes(B, 0.0) @ gravity(r)
        assert g[2] == pytest.approx(expected, abs=2e-6)
        assert np.abs(g[:2]).max() < 2e-6


@pytest.mark.slow
def test_a_flight_without_noise_is_where_the_simulator_had_it() -> None:
    """Oracle: exact simulated motion; ideal samples at 100 Hz, fixes of 2 cm."""
    sim = simulate_flight("ign6x1", 3.0, seed=2, imu=ImuOptions(100.0, None), truth_hz=1.0)
    exact = sim.truth.eo
    mounting = sim.mounting
    chosen = (exact.time > exact.time[0]) & (exact.time < exact.time[0] + 70.0)
    setup = Setup(
        np.eye(3),
        (),
        np.array([1e-10] * 3 + [1e-8] * 3),
        mounting.antenna_lever_b,
        np.full(3, 1e-4),
        1e-6,
        mounting.camera_lever_b,
        mounting.C_cb,
        exact.origin,
    )
    span = float(exact.time[0]) - 2.0, float(exact.time[0]) + 80.0
    poses = image_poses(setup, sim.imu, sim.gnss, exact.time[chosen], span)
    error = poses.position_m - exact.position_m[chosen]
    turned = rotation_vector(poses.C_mc @ np.swapaxes(exact.C_mc[chosen], 1, 2))
    assert np.abs(error).max() < 0.02
    assert np.degrees(np.abs(turned[:, :2]).max()) < 0.02
    assert np.degrees(np.abs(turned[:, 2]).max()) < 0.1


@pytest.fixture(scope="module")
def part(tmp_path_factory):
    """A minute of a corridor, as `verify` cuts it."""
    from insgnss.flight.processing.recording import read_recording
    from insgnss.flight.processing.solve_segments import solve_segments

    root = tmp_path_factory.mktemp("poses") / "flight"
    data = write_dataset(root, "ign6x1", 4.0, imu_rate=100.0, seed=4)
    flight = load_flight(data.flight_file)
    recording = read_recording(flight)
    cut = _cut_flight(flight, recording, 60.0, None)
    (segment,), _ = solve_segments(cut, recording, lambda _: None)
    return cut, recording, segment


@pytest.mark.slow
def test_the_images_of_a_flight_agree_and_those_of_a_wrong_chain_do_not(part, monkeypatch) -> None:
    """Oracle: the other implementation; planted: lever arm to the camera the other way, bore-sight
    after the nominal turn.
    """
    cut, recording, segment = part
    right = compare_images(cut, recording, segment)
    assert right.images > 20
    assert right.in_sigmas < LIMIT_POSE_SIGMAS
    assert "agree" in right.sentence()
    m, setup = cut.mounting, independent._setup
    for wrong in (
        replace(m, imu_m=-m.imu_m),
        replace(m, boresight=m.camera_from_body.T @ m.boresight @ m.camera_from_body),
    ):
        with monkeypatch.context() as patch:
            patch.setattr(independent, "_setup", lambda flight, *rest: setup(cut, *rest))
            found = compare_images(replace(cut, mounting=wrong), recording, segment)
        assert found.in_sigmas > 1.0
        assert "DO NOT AGREE" in found.sentence()


def test_white_noise_that_the_core_takes_otherwise_is_seen(part) -> None:
    """Oracle: the noise model of the flight; the core solved with a third of its root densities."""
    cut, recording, segment = part
    triads = {
        name: tuple(
            replace(a, white_noise=3.0 * a.white_noise) for a in getattr(recording.noise, name)
        )
        for name in ("gyro", "accel")
    }
    found = compare_images(
        cut, replace(recording, noise=replace(recording.noise, **triads)), segment
    )
    assert found.in_sigmas > LIMIT_POSE_SIGMAS


@pytest.mark.slow
def test_what_the_independent_path_does_not_know_is_said(part) -> None:
    """Oracle: by hand."""
    cut, recording, segment = part
    assert (
        "(55 s needed)"
        in compare_images(
            cut, recording, replace(segment, solution=sub_solution(segment.solution, 0, 100))
        ).sentence()
    )
    stated = replace(cut, mounting=replace(cut.mounting, antenna_sigma_m=1e-5))
    assert (
        "contradicts the stated lever arm" in compare_images(stated, recording, segment).sentence()
    )
