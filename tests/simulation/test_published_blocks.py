"""Image blocks of papers 003 and 004: the numbers of their tables, exact pixels, and errors of
poses with the statistics that are written.
"""

from functools import cache

import numpy as np
import pytest
from draws import lower_factor
from numpy.testing import assert_allclose

from insgnss.cli.main import main
from insgnss.geodesy.frames import TangentPlane
from insgnss.geodesy.rotation import vector_from_rotation
from insgnss.io.formats.blocks.camera_toml import read_camera_toml
from insgnss.io.formats.blocks.ground_points import read_ground_points
from insgnss.io.formats.blocks.image_points import read_image_points
from insgnss.io.formats.orientation.eo_covariance import read_common_errors, read_eo_covariance
from insgnss.io.formats.orientation.eo_json import read_eo_json
from insgnss.io.formats.trajectory.trajectory_csv import read_trajectory_csv
from insgnss.simulation.plug import import_plugged

write_survey = import_plugged("published_blocks.files").write_survey
PoseErrors = import_plugged("published_blocks.pose_errors").PoseErrors
SimulatedSurvey = import_plugged("published_blocks.survey").SimulatedSurvey
simulate_survey = import_plugged("published_blocks.survey").simulate_survey

BLOCKS = ("block2015", "corridor2014", "mapkite")
OF_EACH = ["corridor2014", *(pytest.param(b, marks=pytest.mark.slow) for b in BLOCKS[::2])]


@cache
def made(name: str, seed: int = 0) -> SimulatedSurvey:
    return simulate_survey(name, seed)


def rays(block: SimulatedSurvey, first: str) -> np.ndarray:
    """Measurements of each point whose name begins so."""
    count = np.bincount(block.measured.observations.point, minlength=len(block.measured.points))
    return count[[name[0] == first for name in block.measured.points]]


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    ("name", "photos", "ties", "tie_rays", "control", "check"),
    [
        ("block2015", 207, 4926, 105552 // 2, (5, 94 // 2), (15, 534 // 2)),
        ("corridor2014", 55, 1595, 17040 // 2, (3, 32 // 2), (6, 98 // 2)),
    ],
)
def test_numbers_are_those_of_table_2(name, photos, ties, tie_rays, control, check, seed) -> None:
    """Oracle: Table 2 of paper 003, two observations a measurement; heights of its text."""
    block = made(name, seed)
    assert len(block.truth) == photos
    tie, ground = rays(block, "T"), rays(block, "G")
    assert (tie.size, tie.sum(), tie.min() >= 2) == (ties, tie_rays, True)
    of_control, of_check = ground[~block.ground.check], ground[block.ground.check]
    assert (of_control.size, of_control.sum()) == control
    assert (of_check.size, of_check.sum()) == check
    assert ground.min() >= 3
    height = block.truth.position_m[:, 2].round(-1)
    assert set(height) <= ({120.0, 150.0} if name == "block2015" else {130.0})
    control_at = block.ground.position_m[~block.ground.check, :2]
    assert np.ptp(control_at, axis=0).max() < 230.0
    apart = np.linalg.norm(block.ground.position_m[:, :2] - control_at.mean(axis=0), axis=1)
    assert apart[block.ground.check].max() > 400.0


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_numbers_of_the_corridor_with_a_vehicle(seed) -> None:
    """Oracle: 3.1, 3.2, Tables 1 and 2 of paper 004."""
    block = made("mapkite", seed)
    tie, targets, own = rays(block, "T"), rays(block, "D"), rays(block, "K")
    assert (len(block.truth), tie.size, tie.sum(), tie.min()) == (149, 6912, 24712, 3)
    assert (targets.size, (~block.ground.check).sum(), block.ground.check.sum()) == (37, 19, 18)
    assert targets.min() >= 3
    assert own.tolist() == [1] * 136
    seen = block.measured.observations
    kinematic = np.array([p.startswith("K_") for p in block.measured.points])[seen.point]
    images = [block.measured.images[k] for k in seen.image[kinematic]]
    assert [f"K_{name}" for name in images] == [
        block.measured.points[k] for k in seen.point[kinematic]
    ]
    assert set(seen.sigma_px[kinematic].ravel()) == {0.5}
    assert set(seen.sigma_px[~kinematic].ravel()) == {0.83}
    assert np.sqrt(block.ground.cov[0].diagonal()).tolist() == pytest.approx([0.015] * 3)
    assert np.sqrt(block.eo.cov[0].diagonal())[:3].tolist() == pytest.approx([0.02, 0.02, 0.05])
    way = np.linalg.norm(np.diff(block.truth.position_m[:, :2], axis=0), axis=1)
    assert 2200.0 < way.sum() < 2450.0
    ground = block.terrain.points(block.truth.position_m[:, :2])[:, 2]
    height = block.truth.position_m[:, 2] - ground
    assert 78.0 < height.min() < height.max() < 92.0
    pitch = np.degrees(np.arcsin(block.truth.C_mc[:, 2, 1]))  # of the image's long axis
    assert np.abs(pitch).max() > 7.0


@pytest.mark.parametrize("name", OF_EACH)
def test_pixels_without_error_are_collinear(name) -> None:
    """Oracle: collinearity and Brown's distortion in a few lines, from Brown's paper."""
    block = made(name)
    seen, eo = block.measured.observations, block.truth
    f, cx, cy, b1, b2, k1, k2, k3, _, p1, p2 = block.survey.camera.interior
    away = block.position_m[seen.point] - eo.position_m[seen.image]
    x, y, z = np.einsum("nji,nj->in", eo.C_mc[seen.image], away)
    x, y = x / z, y / z
    r2 = x**2 + y**2
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    u = cx + f * (x * radial + p1 * (r2 + 2 * x**2) + 2 * p2 * x * y)
    v = cy + f * (y * radial + p2 * (r2 + 2 * y**2) + 2 * p1 * x * y)
    assert (b1, b2) == (0.0, 0.0)
    assert_allclose(block.uv, np.column_stack([u, v]), rtol=0, atol=1e-6)
    error = (seen.uv - block.uv) / seen.sigma_px
    assert abs(error.mean()) < 4.0 / np.sqrt(error.size)
    assert abs(error.std() - 1.0) < 4.0 / np.sqrt(2 * error.size)


@pytest.mark.parametrize(
    "seeds", [range(40), pytest.param(range(100, 140), marks=pytest.mark.slow)]
)
def test_errors_of_poses_have_their_statistics(seeds) -> None:
    """Oracle: variances, white share and exponential correlation of (B.2), by chi-square of errors
    whitened with them and by correlations at a lag, each within 4 standard errors.
    """
    time, C = made("corridor2014").truth.time, made("corridor2014").truth.C_mc
    errors = PoseErrors()
    drawn = np.array([errors.draw(time, C, np.random.default_rng(seed)) for seed in seeds])
    drawn[:, :, 3:] = np.einsum("nji,snj->sni", C, drawn[:, :, 3:])  # along the camera's axes
    apart = np.abs(time[:, None] - time)
    cov = 0.75 * np.exp(-apart / 300.0) + 0.25 * np.eye(time.size)
    sigma = np.r_[0.035, 0.035, 0.03, np.radians([0.045, 0.045, 0.125])]
    white = np.linalg.solve(lower_factor(cov), (drawn / sigma))
    n = white.size
    assert abs((white**2).sum() - n) < 4.0 * np.sqrt(2.0 * n)
    for k in range(6):
        part = white[:, :, k]
        assert abs((part**2).sum() - part.size) < 4.0 * np.sqrt(2.0 * part.size)
    # what lasts over half the flight: 240 products of a mean of each half
    half = time.size // 2
    first, last = drawn[:, :half].mean(axis=1) / sigma, drawn[:, half:].mean(axis=1) / sigma
    expected = cov[:half, half:].mean()
    spread = np.sqrt(cov[:half, :half].mean() * cov[half:, half:].mean() + expected**2)
    assert abs((first * last).mean() - expected) < 4.0 * spread / np.sqrt(first.size)


@pytest.mark.parametrize("name", OF_EACH)
def test_the_file_has_the_whole_covariance(name, tmp_path) -> None:
    """Oracle: the covariance of all poses by (B.2); between lines the shared errors have all of it,
    and what is left of each line is positive semi-definite.
    """
    block, errors = made(name), made(name).survey.errors
    write_survey(tmp_path / "d", block)
    eo = read_eo_json(tmp_path / "d/eo.json")
    strips = read_eo_covariance(tmp_path / "d/eo_covariance.npz", eo)
    common = read_common_errors(tmp_path / "d/eo_covariance.npz", eo)
    n = len(eo)
    A = common.factor.reshape(6 * n, -1)
    whole = A @ A.T
    for strip in strips:
        columns = (6 * strip.rows[:, None] + np.arange(6)).ravel()
        rest = common.rest(strip.rows, strip.cov)
        root = np.sqrt(np.diagonal(strip.cov))
        assert np.linalg.eigvalsh(rest / root / root[:, None])[0] > -1e-9
        whole[np.ix_(columns, columns)] += rest
    alone = np.setdiff1d(np.arange(n), np.concatenate([s.rows for s in strips]))
    for k in alone:
        whole[6 * k : 6 * k + 6, 6 * k : 6 * k + 6] = eo.cov[k]
    apart = np.abs(eo.time[:, None] - eo.time)
    rho = 0.75 * np.exp(-apart / 300.0) + 0.25 * np.eye(n)
    sigma = np.r_[errors.position_m, np.radians(errors.attitude_deg)]
    turn = np.tile(np.eye(6), (n, 1, 1))
    if name != "mapkite":  # tilts and headings there are an autopilot's
        turn[:, 3:, 3:] = block.truth.C_mc
    expected = np.einsum("jab,b,kcb,jk->jakc", turn, sigma**2, turn, rho).reshape(6 * n, 6 * n)
    size = np.tile(sigma, n)
    assert np.abs((whole - expected) / size / size[:, None]).max() < 1e-9
    assert_allclose(
        eo.cross,
        [expected[6 * k : 6 * k + 6, 6 * k + 6 : 6 * k + 12] for k in range(n - 1)],
        rtol=0,
        atol=1e-15,
    )


@pytest.mark.slow
@pytest.mark.parametrize("first", [0, 50])
def test_poses_against_the_truth(first) -> None:
    """Oracle: normalised estimation error squared of all poses of ten corridors at once, chi-square
    within 4 standard deviations; errors are truth minus estimate, read from the poses themselves.
    """
    total, n = 0.0, 0
    for seed in range(first, first + 10):
        block = made("corridor2014", seed)
        psi = vector_from_rotation(block.truth.C_mc @ block.eo.C_mc.transpose(0, 2, 1))
        error = np.hstack([block.truth.position_m - block.eo.position_m, psi])
        assert_allclose(error, block.pose_errors, rtol=0, atol=1e-9)
        cov = block.survey.errors.covariance(block.eo.time, block.truth.C_mc)
        scale = np.tile(block.survey.errors.sigma, len(error))
        root = np.linalg.cholesky(cov / scale / scale[:, None])
        white = np.linalg.solve(root, error.ravel() / scale)
        total, n = total + float((white**2).sum()), n + white.size
    assert abs(total - n) < 4.0 * np.sqrt(2.0 * n)


def test_a_bore_sight_is_in_the_images_and_not_in_the_poses() -> None:
    """Oracle: E of (J.9); without it the poses are those of the same seed."""
    plain, turned = made("corridor2014", 2), simulate_survey("corridor2014", 2, boresight_deg=1.5)
    assert_allclose(turned.truth.C_mc, plain.truth.C_mc, rtol=0, atol=0)
    assert_allclose(turned.eo.C_mc @ turned.boresight, plain.eo.C_mc, rtol=0, atol=1e-12)
    angle = np.degrees(np.linalg.norm(vector_from_rotation(turned.boresight)))
    assert angle == pytest.approx(1.5, abs=1e-9)


@pytest.mark.slow
def test_the_vehicle_is_where_its_file_says(tmp_path) -> None:
    """Oracle: positions are the integral of velocities (Simpson); the target by its lever arm;
    errors of the file against its standard deviations; apparent sizes against the distance.
    """
    block = made("mapkite")
    truth, plane = block.vehicle.truth, TangentPlane(*block.truth.origin)
    position = plane.position_from_geodetic(truth.lat, truth.lon, truth.height)
    C_mn = plane.C_mn(truth.lat, truth.lon)
    v = np.einsum("nij,nj->ni", C_mn, truth.velocity_ned)
    moved = 0.1 / 3.0 * (v[:-2:2] + 4.0 * v[1:-1:2] + v[2::2])
    assert_allclose(np.diff(position[::2], axis=0)[: len(moved)], moved, rtol=0, atol=2e-5)
    target = position + C_mn @ truth.C_nb @ [-0.35, 0.10, -1.20]
    at = np.column_stack([np.interp(block.truth.time, truth.time, target[:, k]) for k in range(3)])
    assert (
        np.abs(at - block.vehicle.target_m).max() < 0.01
    )  # straight between rows, in the turn too
    write_survey(tmp_path / "d", block)
    table = read_trajectory_csv(tmp_path / "d/vehicle.csv")
    off = position - plane.position_from_geodetic(table.lat, table.lon, table.height)
    rms = np.sqrt((off**2).mean(axis=0))
    assert (rms < [0.06, 0.06, 0.12]).all()  # three sigmas, since what lasts is one draw
    assert (rms > [0.008, 0.008, 0.016]).all()  # what does not last is a quarter of the variance
    assert table.sigma[0, [1, 0, 2]].tolist() == [0.02, 0.02, 0.04]
    image, size = block.sizes
    away = block.vehicle.target_m[image] - block.truth.position_m[image]
    depth = np.einsum("ni,ni->n", away, block.truth.C_mc[image][:, :, 2])
    off_px = (size - block.survey.camera.of("f") / depth) / 0.2
    assert abs(off_px.std() - 1.0) < 4.0 / np.sqrt(2 * off_px.size)


@pytest.mark.slow
def test_files_hold_what_was_simulated(tmp_path) -> None:
    """Oracle: the block in memory; bytes of a second run of the same seed."""
    block = made("corridor2014", 3)
    for name in ("a", "b"):
        write_survey(tmp_path / name, block if name == "a" else simulate_survey("corridor2014", 3))
    files = sorted(p.relative_to(tmp_path / "a") for p in (tmp_path / "a").rglob("*.*"))
    for file in files:
        if file.suffix != ".npz" or file.parent.name != "truth":  # zip archives have dates
            assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()
    read = read_image_points(tmp_path / "a/image_points.csv")
    assert len(read.observations) == len(block.measured.observations)
    ground = read_ground_points(tmp_path / "a/ground_points.csv")
    assert ground.check.sum() == 6
    stated = read_camera_toml(tmp_path / "a/camera.toml")
    assert stated.free == ("f", "cx", "cy", "k1", "k2")
    assert 2.0 < abs(stated.of("f") - block.survey.camera.of("f")) < 6.0
    assert read_camera_toml(tmp_path / "a/camera_calibrated.toml").free == ()
    assert read_camera_toml(tmp_path / "a/truth/camera.toml").of("f") == block.survey.camera.of("f")


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ("--flight block2015 --minutes 3", "--minutes has no effect with --flight block2015"),
        ("--flight mapkite --imu-rate 100", "--imu-rate has no effect"),
        ("--flight mapkite --vibration 2", "--vibration has no effect"),
        ("--flight corridor2014 --raw-gnss", "--raw-gnss has no effect"),
        ("--flight corridor2014 --block", "--block has no effect"),
        ("--flight corridor2014 --gross-errors 0.1", "--gross-errors: has no meaning"),
        ("--flight corridor2014 --unknown-boresight 20", "lies within 0 to 10"),
        (
            "--flight ign8 --unknown-boresight 2",
            "--unknown-boresight is only for --flight block2015",
        ),
    ],
)
def test_what_has_no_meaning_is_refused(given, says, tmp_path, capsys) -> None:
    """Oracle: sizes are those of the papers, and there are no sensors."""
    assert main(["simulate", "-q", str(tmp_path / "d"), *given.split()]) == 2
    assert says in capsys.readouterr().err
    assert not (tmp_path / "d").exists()


@pytest.mark.slow
@pytest.mark.parametrize(("name", "seed"), [("corridor2014", 4), ("mapkite", 5), ("block2015", 6)])
def test_the_block_file_adjusts(name, seed, tmp_path, capsys) -> None:
    """Oracle: true poses: their normalised error squared, each image by itself, below the mean that
    one draw of lasting errors allows (chi-square of 6 at 1e-5, 33, over 6); exit code 0.
    """
    directory = tmp_path / "d"
    assert main(["simulate", "-q", str(directory), "--flight", name, "--seed", str(seed)]) == 0
    assert main(["adjust", "-q", str(directory / "block.toml")]) == 0
    truth = np.load(directory / "truth/eo.npz")
    eo = read_eo_json(directory / "adjusted/eo.json")
    psi = vector_from_rotation(truth["C_mc"] @ eo.C_mc.transpose(0, 2, 1))
    error = np.hstack([truth["position_enu"] - eo.position_m, psi])
    nees = np.einsum("ni,nij,nj->n", error, np.linalg.inv(eo.cov), error) / 6.0
    assert nees.mean() < 33.0 / 6.0
    capsys.readouterr()
