"""Image observations of a simulated flight, against the truth and against the adjustment."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from insgnss.base.errors import UsageError
from insgnss.cli.main import main
from insgnss.geodesy.rotation import rotation_from_vector, vector_from_rotation
from insgnss.io.formats.blocks.camera_toml import read_camera_toml
from insgnss.io.formats.blocks.ground_points import read_ground_points
from insgnss.io.formats.blocks.image_points import read_image_points
from insgnss.io.formats.blocks.joined import join_block
from insgnss.io.formats.blocks.measured_block import of_table
from insgnss.photogrammetry.adjust.adjustment import adjust_problem
from insgnss.photogrammetry.adjust.groups import control_points
from insgnss.photogrammetry.adjust.normals import problem_of
from insgnss.photogrammetry.adjust.outliers import without_outliers
from insgnss.photogrammetry.adjust.precision import precision_of
from insgnss.photogrammetry.adjust.start import first_values
from insgnss.records.block import INTERIOR, BrownCamera
from insgnss.simulation.dataset import write_dataset
from insgnss.simulation.image_block import IGN8, LEADING, BlockOptions, simulate_block
from insgnss.simulation.scenario import SimulatedFlight, simulate_flight
from insgnss.simulation.sensors import ImuOptions

FLIGHT = {"minutes": 3.0, "start_in_air": True}
BLOCK = "01_Observations/Camera/Block"


def flown(seed: int = 3, flight: str = "ign8", **changes) -> SimulatedFlight:
    imu = ImuOptions(rate_hz=20.0, noise=None)
    return simulate_flight(flight, seed=seed, imu=imu, **{**FLIGHT, **changes})


@pytest.fixture(scope="module")
def simulated() -> SimulatedFlight:
    return flown()


def collinearity(X, X0, C, camera: BrownCamera):
    """Pixels of points (n, 3) in images of poses (n, 3), (n, 3, 3), from Brown's paper and
    Metashape's manual, not from the package.
    """
    f, cx, cy, b1, b2, k1, k2, k3, _, p1, p2 = camera.interior
    x, y, z = np.einsum("nji,nj->in", C, X - X0)
    x, y = x / z, y / z
    r2 = x**2 + y**2
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    xd = x * radial + p1 * (r2 + 2 * x**2) + 2 * p2 * x * y
    yd = y * radial + p2 * (r2 + 2 * y**2) + 2 * p1 * x * y
    return np.column_stack([cx + xd * f + xd * b1 + yd * b2, cy + yd * f])


def test_pixels_without_error_are_those_of_true_poses_points_and_camera(simulated) -> None:
    """Oracle: collinearity and Brown's distortion in ten lines; the paper's values of Table 3."""
    made = simulate_block(simulated, BlockOptions(gross_errors=0.1), 5)
    seen, eo = made.measured.observations, simulated.truth.eo
    camera = made.options.true_camera
    half = (camera.width / 2, camera.height / 2)
    paper = [5608.347, 30.283 + half[0], 52.558 + half[1], -0.04752, 0.11218]
    paper += [0.01619, -0.06237, 0.06423, 0.0, -0.00093, 0.00104]
    assert camera.interior.tolist() == pytest.approx(paper, rel=1e-15)
    pixels = collinearity(
        made.position_m[seen.point], eo.position_m[seen.image], eo.C_mc[seen.image], camera
    )
    assert_allclose(made.uv, pixels, rtol=0, atol=1e-6)
    assert made.uv.min() > 0.0
    assert (made.uv < (camera.width, camera.height)).all()


@pytest.mark.parametrize("seed", [5, 6])
def test_errors_are_as_stated(simulated, seed) -> None:
    """Oracle: 4 standard errors of mean and standard deviation of normal draws, of a share, and of
    surveyed targets; the bounds of gross errors.
    """
    made = simulate_block(simulated, BlockOptions(gross_errors=0.05), seed)
    seen = made.measured.observations
    tie = np.array([name.startswith("T") for name in made.measured.points])[seen.point]
    error = (seen.uv - made.uv) / seen.sigma_px
    assert set(seen.sigma_px[tie].ravel()) == {0.5}
    assert set(seen.sigma_px[~tie].ravel()) == {0.2}
    for of in (tie & ~made.gross, ~tie & ~made.gross):
        n = 2 * of.sum()
        assert abs(error[of].mean()) < 4.0 / np.sqrt(n)
        assert abs(error[of].std() - 1.0) < 4.0 / np.sqrt(2 * n)
    n = len(seen)
    assert abs(made.gross.mean() - 0.05) < 4.0 * np.sqrt(0.05 * 0.95 / n)
    off = np.linalg.norm((seen.uv - made.uv)[made.gross], axis=1)
    assert 7.0 < off.min() < off.max() < 103.0
    true = made.position_m[-len(made.ground.points) :]
    survey = (made.ground.position_m - true) / (0.010, 0.010, 0.015)
    assert abs(survey.std() - 1.0) < 4.0 / np.sqrt(2 * survey.size)
    assert made.ground.check.sum() == 4
    assert len(made.ground.points) == 25


def test_points_lie_on_rolling_ground_and_are_seen_from_two_images(simulated) -> None:
    """Oracle: relief and slope that the docstring states; two rays of a tie point, three of a
    target; 52 tie points an image.
    """
    made = simulate_block(simulated, seed=5)
    up = made.position_m[:, 2] - 510.0
    assert np.abs(up).max() <= 16.0
    assert up.std() > 2.0
    slope = np.hypot(*made.terrain.wave) @ made.terrain.amplitude_m
    assert slope < np.tan(np.radians(19.0))
    tie = np.array([name.startswith("T") for name in made.measured.points])
    rays = np.bincount(made.measured.observations.point, minlength=tie.size)
    assert rays[tie].min() >= 2
    assert rays[~tie].min() >= 3
    assert tie.sum() == 52 * len(simulated.truth.eo.images)


def test_the_corridor_has_check_points_alone() -> None:
    """Oracle: Table 7 of paper 000, and what it calls Lead."""
    made = simulate_block(flown(flight="ign6x1"), seed=1)
    assert made.ground.check.all()
    assert len(made.ground.points) == 24
    assert made.options.stated_camera.free == LEADING


def test_streams_are_independent(simulated) -> None:
    """Oracle: the same seed gives the same numbers, another one others; gross errors change no
    other number.
    """
    a, b, c = (simulate_block(simulated, seed=seed) for seed in (5, 5, 6))
    assert (a.measured.observations.uv == b.measured.observations.uv).all()
    assert a.position_m[0, 0] != c.position_m[0, 0]
    spoiled = simulate_block(simulated, BlockOptions(gross_errors=0.2), 5)
    good = ~spoiled.gross
    assert (spoiled.measured.observations.uv == a.measured.observations.uv)[good].all()
    assert (spoiled.ground.position_m == a.ground.position_m).all()


def test_a_block_leaves_the_flight_as_it_is(tmp_path) -> None:
    """Oracle: the bytes of the files of the same flight without block; targets and readmes are
    others.
    """
    options = {"imu_rate": 20.0, "seed": 3, "start_in_air": True, "minutes": 2.0}
    write_dataset(tmp_path / "without", **options)
    write_dataset(tmp_path / "with", **options, block=BlockOptions(gross_errors=0.05))
    files = {
        name: {p.relative_to(tmp_path / name).as_posix() for p in (tmp_path / name).rglob("*.*")}
        for name in ("without", "with")
    }
    new = {f"{BLOCK}/{name}" for name in ("image_points.csv", "ground_points.csv", "camera.toml")}
    assert files["with"] - files["without"] == new | {
        "block.toml",
        "truth/block.npz",
        "truth/camera.toml",
    }
    told = {
        "README.md",
        "FLIGHT.md",
        *(f"01_Observations/Camera/GCPs/{name}.txt" for name in ("WGS84", "WGS84_tangentplane")),
    }
    for file in files["without"] - told:
        if (tmp_path / "with" / file).is_file():
            with_block, without = ((tmp_path / x / file).read_bytes() for x in ("with", "without"))
            assert with_block == without, file


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A data set with a block, by the command line."""
    root = tmp_path_factory.mktemp("block") / "d"
    given = "--minutes 6 --imu-rate 20 --seed 4 --block --gross-errors 0.02 -q"
    assert main(["simulate", str(root), *given.split()]) == 0
    return root


def test_what_was_written_is_read_back_and_told(written) -> None:
    """Oracle: the truth files, noise of 0.5 px and gross errors of 100 px at most; the names of the
    files in README.md, the numbers in FLIGHT.md.
    """
    measured = read_image_points(written / BLOCK / "image_points.csv")
    ground = read_ground_points(written / BLOCK / "ground_points.csv")
    truth = np.load(written / "truth/block.npz")
    eo = np.load(written / "truth/eo.npz")
    camera = read_camera_toml(written / "truth/camera.toml")
    seen = measured.observations
    names = [measured.images[i] for i in seen.image]
    assert names == eo["images"][truth["image"]].tolist()
    assert [measured.points[p] for p in seen.point] == truth["points"][truth["point"]].tolist()
    off = np.linalg.norm(seen.uv - truth["uv"], axis=1)
    assert off[~truth["gross_error"]].max() < 0.5 * 6.0
    assert off[truth["gross_error"]].min() > 7.0
    pixels = collinearity(
        truth["position_enu"][truth["point"]],
        eo["position_enu"][truth["image"]],
        eo["C_mc"][truth["image"]],
        camera,
    )
    assert_allclose(truth["uv"], pixels, rtol=0, atol=1e-6)
    readme, figures = ((written / name).read_text() for name in ("README.md", "FLIGHT.md"))
    for name in ("image_points.csv", "ground_points.csv", "camera.toml"):
        assert name in readme
    assert f"- Image points: {len(seen)} of {sum(x[0] == 'T' for x in truth['points'])} tie" in (
        figures
    )
    assert f"gross errors: {truth['gross_error'].sum()}\n" in figures
    targets = (written / "01_Observations/Camera/GCPs/WGS84_tangentplane.txt").read_text()
    table = [line.split() for line in targets.splitlines()[1:]]
    assert [row[0] for row in table] == list(ground.points)
    assert_allclose(np.array([row[1:] for row in table], float), ground.position_m, atol=1.1e-4)


def perturbed(simulated: SimulatedFlight, seed: int):
    """The true poses with errors of 2 m and 1 deg."""
    eo, rng = simulated.truth.eo, np.random.default_rng([9, seed])
    n = len(eo.images)
    turn = rotation_from_vector(np.radians(1.0) * rng.standard_normal((n, 3)))
    position = eo.position_m + 2.0 * rng.standard_normal((n, 3))
    return replace(eo, position_m=position, C_mc=turn @ eo.C_mc)


@pytest.mark.parametrize("seed", [1, 2])
def test_an_adjustment_gets_the_truth(seed) -> None:
    """Oracle: the truth: the NEES of all poses and of the camera's ten parameters in their 99.9 %
    bounds, as that of the check points by their own covariance and that of the block; sigma_0 of 1
    by its redundancy.
    """
    from scipy.stats import chi2

    simulated = flown(seed, minutes=5.0)
    options = BlockOptions(tie_points=30.0, check=6)
    made = simulate_block(simulated, options, seed)
    block = join_block(
        of_table(made.measured, options.stated_camera), made.ground, perturbed(simulated, seed)
    ).block
    result = adjust_problem(problem_of(block, control_points(block.control)), first_values(block))
    precision = precision_of(result, 1.0)
    eo, values = simulated.truth.eo, result.values
    row = [eo.images.index(name) for name in block.images]
    psi = vector_from_rotation(eo.C_mc[row] @ values.C_mc.transpose(0, 2, 1))
    error = np.hstack([eo.position_m[row] - values.position, psi]).ravel()
    keys = [("pose", i) for i in range(len(row))]
    free = [k for k, name in enumerate(INTERIOR) if name in options.stated_camera.free]
    error = np.concatenate([error, (IGN8.interior - values.interior[0])[free]])
    bounds = chi2.ppf((5e-4, 1.0 - 5e-4), error.size)
    P = precision.cov(*keys, ("camera", 0))
    assert bounds[0] < error @ np.linalg.solve(P, error) < bounds[1]
    check = block.check
    off = check.position_m - values.point[check.point]
    cov = check.cov + precision.point_cov[check.point]
    total = sum(e @ np.linalg.solve(S, e) for e, S in zip(off, cov, strict=True))
    assert total < chi2.ppf(1.0 - 5e-4, off.size)
    low, high = chi2.ppf((5e-4, 1.0 - 5e-4), result.redundancy)
    assert low < result.cost < high


@pytest.mark.slow
def test_gross_errors_are_those_that_an_adjustment_rejects() -> None:
    """Oracle: the truth of which observations are off; those that remain lie within their minimal
    detectable biases, so that the block's sigma_0 is 1 to 5 %.
    """
    simulated = flown(7, minutes=5.0)
    made = simulate_block(simulated, BlockOptions(tie_points=30.0, gross_errors=0.02), 7)
    block = join_block(of_table(made.measured, IGN8), made.ground, perturbed(simulated, 7)).block
    problem = problem_of(block, control_points(block.control))
    cleaned = without_outliers(problem, first_values(block))
    assert cleaned.result.sigma0 == pytest.approx(1.0, abs=0.05)
    rejected = np.zeros(len(made.uv), dtype=bool)
    rejected[cleaned.rejected] = True
    assert (rejected & made.gross).sum() > 0.9 * made.gross.sum()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("--flight car --block", "flight 'car' is no survey and has no image block"),
        ("--minutes 2 --gross-errors 0.1", "--gross-errors: has no meaning without --block"),
        (
            "--block images",
            "--block images: is not a survey flight (ign8 and ign6x1)",
        ),
        ("--flight ign8 --block ign6x1", "are two flights; keep one"),
        ("--minutes 2 --block --gross-errors 5", "block.gross_errors = 5.0: must be 0 to 0.5"),
    ],
)
def test_what_has_no_block_is_refused(tmp_path, capsys, given, message) -> None:
    """Oracle: the contract; nothing is written."""
    assert main(["simulate", str(tmp_path / "d"), *given.split(), "-q", "--imu-rate", "20"]) == 2
    assert message in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_block_may_name_its_flight(tmp_path, capsys) -> None:
    """Oracle: the corridor's image names, which begin with 6, and the files of an adjustment."""
    words = "--block ign6x1 --minutes 3 --imu-rate 20"
    assert main(["simulate", str(tmp_path / "d"), *words.split()]) == 0
    assert "then insgnss adjust" in capsys.readouterr().out
    images = read_image_points(tmp_path / "d" / BLOCK / "image_points.csv").images
    assert {name[0] for name in images} == {"6"}
    assert (tmp_path / "d/block.toml").is_file()


def test_a_flight_without_overlap_is_refused(simulated) -> None:
    """Oracle: one image, in which nothing is seen twice."""
    eo = simulated.truth.eo
    flight = replace(simulated, truth=replace(simulated.truth, eo=eo[:1]))
    with pytest.raises(UsageError, match="the 1 images of this flight hardly overlap"):
        simulate_block(flight)
    with pytest.raises(UsageError, match="drive is no survey flight"):
        simulate_block(simulate_flight("car", 1.0, imu=ImuOptions(rate_hz=20.0, noise=None)))
