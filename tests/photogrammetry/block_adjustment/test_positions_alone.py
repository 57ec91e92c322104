"""Blocks whose aerial control is positions alone: of drones with RTK or PPK and no IMU log."""

import json
import os
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from insgnss.base.errors import DataError, InputError, UsageError
from insgnss.cli.main import main
from insgnss.geodesy.frames import TangentPlane
from insgnss.geodesy.projection import MapProjection
from insgnss.geodesy.rotation import rotation_from_vector, vector_from_rotation
from insgnss.io.formats.blocks.ground_points import GroundAxes, read_ground_points
from insgnss.photogrammetry.block_adjustment.aerial.control import velocities_by_differences
from insgnss.photogrammetry.block_adjustment.aerial.first_poses import (
    FirstPoses,
    first_attitudes,
    in_other_order,
    lie_elsewhere,
    oriented_similarity,
)
from insgnss.photogrammetry.block_adjustment.aerial.positions import _of_images, _refuse_distant
from insgnss.photogrammetry.block_adjustment.ground import ground_of
from insgnss.photogrammetry.block_adjustment.run import adjust
from insgnss.photogrammetry.block_adjustment.trials import trials
from insgnss.photogrammetry.comparison.poses import Poses
from insgnss.photogrammetry.comparison.reading import read_poses

BLOCK = "01_Observations/Camera/Block"
NO_POSES = FirstPoses(("z",), np.full((1, 3), np.nan), np.eye(3)[None], "of the program")
SIGMA_ENU = np.array([0.02, 0.02, 0.03])
NADIR = np.diag([1.0, -1.0, -1.0])


@pytest.fixture(scope="module")
def without_imu(flown, tmp_path_factory):
    """A function that writes a .MRK of the true cameras with noise, ground points in UTM, and first
    attitudes that are off by a third of a degree."""
    root = flown.directory
    with np.load(root / "truth/eo.npz") as file:
        true = {key: file[key] for key in file.files}
    plane = TangentPlane(*true["origin"])

    def write(seed=1, lever_arm_m=(0.0, 0.0, 0.0), shift=(0, 0.0)):
        directory = tmp_path_factory.mktemp("positions")
        draw = np.random.default_rng(seed)
        X = true["position_enu"] + true["C_mc"] @ np.array(lever_arm_m)
        X = X + SIGMA_ENU * draw.normal(size=X.shape)
        images, north_m = shift
        X[:images, 1] += north_m
        place = np.transpose(plane.geodetic_from_position(X))
        lines = [
            f"{int(name[:4])}\t{tow:.6f}\t[2200]\t0,N\t0,E\t0,V\t{np.degrees(lat):.9f},Lat"
            f"\t{np.degrees(lon):.9f},Lon\t{h:.4f},Ellh\t0.02, 0.02, 0.03\t50,Q\n"
            for name, tow, (lat, lon, h) in zip(true["images"], true["tow"], place, strict=True)
        ]
        (directory / "Timestamp.MRK").write_text("".join(lines))
        ground = read_ground_points(root / BLOCK / "ground_points.csv")
        grid = MapProjection("EPSG:32632").forward(*plane.geodetic_from_position(ground.position_m))
        rows = [
            f"{name},{x:.4f},{y:.4f},{z:.4f},0.01,0.01,0.015,{'check' if check else 'control'}\n"
            for name, (x, y, z), check in zip(ground.points, grid, ground.check, strict=True)
        ]
        head = "point,x,y,z,sigma_x,sigma_y,sigma_z,role\n"
        (directory / "ground.csv").write_text("".join([head, *rows]))
        text = (root / "truth/EO_local-plane.txt").read_text().splitlines()
        table = [line.split() for line in text if not line.startswith("#")]
        off = 0.33 * draw.normal(size=(len(table), 3))
        rows = [
            " ".join(
                [*row[:4], *(f"{float(a) + b:.5f}" for a, b in zip(row[4:7], turn, strict=True))]
            )
            + " 0 0 0 0 0 0"
            for row, turn in zip(table, off, strict=True)
        ]
        heads = [line for line in text if line.startswith("#")]
        (directory / "EO.txt").write_text("\n".join([*heads, *rows]) + "\n")
        return directory

    return write


def block_of(flown, directory, **changes):
    """The block file with positions in place of the flight."""
    block = flown.block
    control = replace(
        block.aerial_control,
        file=directory / "Timestamp.MRK",
        initial=directory / "EO.txt",
        **changes,
    )
    ground = replace(block.ground, file=directory / "ground.csv", crs="EPSG:32632")
    return replace(block, aerial_control=control, ground=ground)


def normalised(flown, done):
    """Normalised squares (n,) of all poses against the truth, over their degrees of freedom."""
    solved = done.solved
    values, images = solved.result.values, solved.result.problem.block.images
    with np.load(flown.directory / "truth/eo.npz") as file:
        row = {str(name): k for k, name in enumerate(file["images"])}
        rows = [row[name] for name in images]
        own, its = TangentPlane(*solved.inputs.eo.origin), TangentPlane(*file["origin"])
        X = own.position_from_geodetic(*its.geodetic_from_position(file["position_enu"][rows]))
        C = own.C_em.T @ its.C_em @ file["C_mc"][rows]
    e = np.hstack([X - values.position, vector_from_rotation(C @ values.C_mc.swapaxes(1, 2))])
    return np.einsum("ni,nij,nj->n", e, np.linalg.inv(solved.precision.pose_cov), e) / 6.0


@pytest.mark.slow
def test_a_drone_without_imu_is_adjusted_by_one_command(flown, without_imu, tmp_path, capsys):
    """Oracle: the truth of the simulation: normalised squares of all poses near one, although
    neighbours share errors; the products of a block with an IMU but its mounting."""
    directory = without_imu()
    words = ["adjust", str(directory / "Timestamp.MRK")]
    words += ["--images", str(flown.directory / BLOCK / "image_points.csv")]
    words += ["--camera", str(flown.directory / BLOCK / "camera.toml")]
    words += ["--ground", str(directory / "ground.csv"), "--crs", "EPSG:32632"]
    words += ["--initial", str(directory / "EO.txt"), "--out", str(tmp_path / "out")]
    assert main(words) == 0
    text = capsys.readouterr().out
    assert "no observation group contradicts another" in text
    assert "attitudes are estimated from the image observations" in " ".join(text.split())
    assert re.search(r"lever arm .* known to \d+ mm along the camera's viewing direction", text)
    lines = json.loads((tmp_path / "out/adjust.json").read_text())["flight_lines"]
    page = re.sub("<[^>]+>", " ", (tmp_path / "out/adjust.html").read_text())
    page = " ".join(page[page.index("Flight lines as they were cut") :].split())
    long = [line for line in lines if line["images"] > 1]
    assert long
    assert all(f"{one['first_image']} {one['last_image']} {one['images']}" in page for one in long)
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        *("EO_local-plane.txt", "adjust.html", "adjust.json", "camera.toml", "eo.json"),
        *("camera_metashape.xml", "poses.csv"),
    }
    z = normalised(flown, adjust(block_of(flown, directory), write=False))
    assert 0.5 < z.mean() < 1.6
    assert np.max(z) < 6.0


@pytest.mark.slow
def test_a_lever_arm_that_is_not_stated_is_allowed_for_and_one_that_is_stated_is_used(
    flown, without_imu
):
    """Oracle: the planted lever arm of the antenna, 18 cm; normalised squares where nobody states
    it, where it is stated, or estimated."""
    arm = (0.15, 0.0, -0.1)
    directory = without_imu(2, arm)
    unknown = adjust(block_of(flown, directory), write=False)
    assert not unknown.judgement.contradicted
    found = unknown.figures["mounting"]["lever arm"]
    assert_allclose(found["value"], arm, atol=4.0 * np.max(found["sigma"]))
    assert 0.5 < normalised(flown, unknown).mean() < 1.6
    stated = adjust(block_of(flown, directory, lever_arm_m=arm), write=False)
    assert stated.figures["mounting"] == {}
    assert 0.5 < normalised(flown, stated).mean() < 1.6
    half = block_of(flown, directory, lever_arm_m=(0.1, 0.0, 0.0), lever_arm_sigma_m=(0.3,) * 3)
    estimated = adjust(half, write=False).figures["mounting"]["lever arm"]
    off = (np.array(estimated["value"]) - [0.05, 0.0, -0.1]) / estimated["sigma"]
    assert np.abs(off).max() < 4.0


@pytest.mark.slow
def test_what_positions_alone_lack_is_asked_for(flown, without_imu, tmp_path, monkeypatch):
    """Oracle: the rules by hand: a CRS of the ground points, a pose to begin with, standard
    deviations."""
    directory = without_imu()
    monkeypatch.setenv("INSGNSS_SHOWN", f"{directory}{os.pathsep}{tmp_path}")
    block = block_of(flown, directory)
    with pytest.raises(InputError, match=r"does not say in which CRS .*--crs"):
        adjust(replace(block, ground=replace(block.ground, crs=None)), write=False)
    control = replace(block.aerial_control, initial=None)
    with pytest.raises(InputError, match=r"0 of .* images have a pose"):
        adjust(replace(block, aerial_control=control), write=False)
    bare = tmp_path / "bare.MRK"
    text = (directory / "Timestamp.MRK").read_text()
    bare.write_text(text.replace("\t0.02, 0.02, 0.03", ""))
    tiny = tmp_path / "tiny.MRK"
    tiny.write_text(text.replace("0.02, 0.02, 0.03", "0.00002, 0.00002, 0.00003"))
    control = replace(block.aerial_control, file=tiny)
    with pytest.raises(InputError, match=r"positions to 0\.024 mm, .* another unit"):
        adjust(replace(block, aerial_control=control), write=False)
    control = replace(block.aerial_control, file=bare)
    with pytest.raises(InputError, match=r"no standard deviations .*--position-sigma"):
        adjust(replace(block, aerial_control=control), write=False)
    with pytest.raises(InputError, match='covariance = "chain"'):
        adjust(block_of(flown, directory, covariance="chain"), write=False)


def turned_block(n_lines, seed=3):
    """Positions in the program's axes, the same measured, and attitudes near the nadir."""
    draw = np.random.default_rng(seed)
    along, across = np.meshgrid(np.arange(12.0), np.arange(float(n_lines)))
    Y = np.column_stack([40.0 * along.ravel(), 60.0 * across.ravel(), 0.0 * along.ravel()])
    C = rotation_from_vector(0.02 * draw.normal(size=(len(Y), 3))) @ NADIR
    R = rotation_from_vector(np.array([0.7, -1.1, 2.0]))  # from the program's axes
    return (Y - 7.0) @ R / 3.5, Y + [500.0, 20.0, 90.0], R.T @ C, R


@pytest.mark.parametrize(("n_lines", "limit_deg"), [(5, 0.1), (1, 1.5)])
def test_a_similarity_turns_the_program_to_the_positions(n_lines, limit_deg):
    """Oracle: the rotation by construction; about a single line it is that of views which are
    straight down on average, here to 0.02 rad / sqrt(12) or so."""
    X, Y, C, R = turned_block(n_lines)
    fitted = oriented_similarity(X, Y, C)
    off = np.degrees(np.linalg.norm(vector_from_rotation(fitted.rotation @ R.T)))
    assert off < limit_deg
    assert fitted.scale == pytest.approx(3.5, rel=1e-4)


class SimpleRows(SimpleNamespace):
    """Rows with a length."""

    def __len__(self) -> int:
        return len(self.time)


def test_velocities_are_differences_within_a_line():
    """Oracle: by hand: two lines at 10 m/s east and west, 2 s between images, a turn of 20 s; of
    an image that no other is near, after another turn, it is not known."""
    time = np.array([0.0, 2.0, 4.0, 24.0, 26.0, 28.0, 60.0])
    x = np.array([0.0, 20.0, 40.0, 40.0, 20.0, 0.0, 20.0])
    position = np.column_stack([x, 50.0 * (time > 10.0), 0.0 * x])
    images = SimpleRows(time=time, position_m=position)
    got = velocities_by_differences(images)
    assert got[:, 0] == pytest.approx([10.0, 10.0, 10.0, -10.0, -10.0, -10.0, 0.0], abs=2e-3)
    assert np.abs(got[:, 1:]).max() < 1e-3


@pytest.mark.parametrize(
    ("names", "images", "expected"),
    [
        (("a.jpg", "b.jpg"), ("b.JPG", "c.JPG"), {"b.JPG": "b.jpg"}),
        (
            tuple(str(k) for k in range(3, 40)),
            tuple(f"DJI_{k:04d}.JPG" for k in range(4, 39) if k != 9),
            {"DJI_0010.JPG": "10"},
        ),
        ((), ("x5.tif", "x9.tif", "x10.tif"), {"x10.tif": "3"}),
    ],
)
def test_positions_find_their_images(names, images, expected):
    """Oracle: by hand: by name, by the counter in the names, by their natural order."""
    n = len(names) or len(images)
    place = {"lat": np.zeros(n), "lon": 1e-6 * np.arange(n), "height": np.zeros(n)}
    poses = SimpleNamespace(images=names, n=n, time=None, source="f.MRK", **place)
    notes = []
    source = SimpleNamespace(measured=SimpleNamespace(images=images[::-1]))
    row, found = _of_images(poses, NO_POSES, source, notes)
    names = names or tuple(str(k + 1) for k in range(n))
    pairs = dict(zip(found, (names[k] for k in row), strict=True))
    assert expected.items() <= pairs.items()
    assert len(pairs) == (1 if "a.jpg" in names else len(images))
    assert bool(notes) == ("a.jpg" not in names)


def test_positions_of_other_images_are_refused():
    """Oracle: by hand: no name, no counter and another number of them."""
    place = {"lat": np.zeros(2), "lon": np.array([0.0, 1e-6]), "height": np.zeros(2)}
    poses = SimpleNamespace(images=("1", "2"), n=2, time=None, source="f.MRK", **place)
    source = SimpleNamespace(measured=SimpleNamespace(images=("x.tif", "y.tif", "z.tif")))
    with pytest.raises(InputError, match=r"none of its 2 positions \(1, \.\.\.\)"):
        _of_images(poses, NO_POSES, source, [])


def posed_block(n_lines=5, on_earth=None):
    """First poses of a block in the program's axes, or on Earth, and the same positions measured
    to 0.3 m."""
    X, Y, C, _ = turned_block(n_lines)
    images = tuple(f"a{k}.tif" for k in range(len(X)))
    Y = Y + 0.3 * np.random.default_rng(1).normal(size=Y.shape)
    return FirstPoses(images, X, C, "of the program", on_earth), Y


@pytest.mark.parametrize(
    ("positions", "images", "words"),
    [
        (np.arange(60), np.arange(60), ""),
        (np.r_[0:17, 16:60], np.arange(60), r"0\.5 m without position 1[78], or .*; remove it"),
        (np.r_[30, 0:60], np.arange(60), r"61 positions and 60 images .* without position 1;"),
        (np.delete(np.arange(60), 20), np.arange(60), r"without image a20\.tif; leave it out"),
        (np.r_[30, 0:59], np.arange(60), r"\+1 off, a29\.tif at position 31; look for a test"),
        (np.r_[0:12, 12:60:3][::-1], np.r_[0:12, 12:60:3], r"in the reverse order, a18\.tif at"),
        (np.arange(12)[:-1], np.arange(12), ""),
        (np.r_[30, 0:20, 21:60], np.arange(60), ""),  # two breaks: it abstains
        (np.r_[[30] * 4, 0:60], np.arange(60), ""),
    ],
)
def test_the_position_or_image_too_many_is_named(positions, images, words):
    """Oracle: the row that the test repeats, leaves out or moves; one line at even steps fits
    without any of its ends; two breaks and four rows are none of the candidates."""
    first, Y = posed_block()
    names = [str(k + 1) for k in range(len(positions))]
    said = in_other_order(names, Y[positions], [first.images[k] for k in images], first)
    assert re.search(words, said) if words else said == ""


def geodetic(positions):
    """Latitudes, longitudes and heights of a plane at 46.5, 7 deg, and the plane."""
    plane = TangentPlane(np.radians(46.5), np.radians(7.0), 0.0)
    return np.column_stack(plane.geodetic_from_position(positions)), plane


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ((1, 0, 2), "it has latitude and longitude exchanged; correct it there"),
        ((1.0, -1.0, 1.0), "longitude with the other sign, or latitude with the other sign"),
    ],
)
def test_mirrored_positions_are_named(change, words, tmp_path):
    """Oracle: the columns that the test exchanges or mirrors; the cameras would look upwards."""
    first, Y = posed_block()
    right, plane = geodetic(Y)
    wrong = right[:, change] if isinstance(change[0], int) else right * change
    got = first_attitudes(tmp_path / "a.MRK", first.images, right, plane, first)
    assert np.degrees(vector_from_rotation(got @ NADIR)).max() < 10.0
    with pytest.raises(InputError, match=words):
        first_attitudes(tmp_path / "a.MRK", first.images, wrong, plane, first)


@pytest.mark.parametrize(
    ("up_m", "words"), [(0.0, "nothing in this block checks"), (50.0, r"lie .* -50\.0 m")]
)
def test_positions_that_no_ground_point_checks_are_reported(up_m, words, tmp_path):
    """Oracle: the heights by which the test moves the first poses of the same images."""
    _, Y = posed_block()
    (lat, lon, height), plane = geodetic(Y)[0].T, geodetic(Y)[1]
    on_earth = SimpleNamespace(images=[f"a{k}.tif" for k in range(60)], lat=lat, lon=lon)
    on_earth.height, on_earth.cov_position = height + up_m, None
    first, _ = posed_block(on_earth=on_earth)
    finding = lie_elsewhere(tmp_path / "a.MRK", first.images, Y, plane, first)
    assert re.search(words, finding.found)
    assert (finding.verdict == "unknown") == (up_m > 0.0)


@pytest.mark.parametrize(
    ("factor", "words"),
    [(1.0 / 0.9, r"b has latitude and longitude in gon"), (np.pi / 180.0, r"longitude in radians")],
)
def test_positions_of_another_place_than_the_first_poses_are_named(factor, words):
    """Oracle: the unit that the test gives the angles, thousands of kilometres off."""
    _, Y = posed_block()
    lat, lon, height = geodetic(Y)[0].T
    images = tuple(f"a{k}.tif" for k in range(60))
    on_earth = Poses("eo.json", "eo_json", "", lat, lon, height, images=images)
    measured = on_earth.moved(factor * lat, factor * lon, height)
    first, _ = posed_block(on_earth=on_earth)
    _refuse_distant(on_earth, images, first)
    with pytest.raises(InputError, match=words):
        _refuse_distant(measured, images, first)


MRK = (
    "7\t275295.301059\t[2024]\t-26,N\t19,E\t191,V\t-36.41144502,Lat\t174.63075195,Lon"
    "\t170.415,Ellh\t0.012, 0.013, 0.021\t50,Q\n"
)
CSV = (
    "image,gps_week,tow,lat_deg,lon_deg,h_m,sd_n_m,sd_e_m,sd_d_m,quality,of_camera\n"
    "7,2024,275295.301059,-36.41144502,174.63075195,170.415,0.012,0.013,0.021,1,1\n"
)


@pytest.mark.parametrize(("name", "text"), [("a.MRK", MRK), ("camera_positions.csv", CSV)])
def test_positions_at_exposures_are_poses_without_attitude(tmp_path, name, text):
    """Oracle: the numbers of the line."""
    (tmp_path / name).write_text(text)
    poses = read_poses(tmp_path / name)
    assert (poses.images, poses.point, poses.gps_week) == (("7",), "projection centre", 2024)
    assert poses.C_Ex is None
    place = [np.degrees(poses.lat[0]), np.degrees(poses.lon[0]), poses.height[0]]
    assert_allclose(place, [-36.41144502, 174.63075195, 170.415], rtol=1e-12)
    assert_allclose(poses.time, [275295.301059])
    assert_allclose(np.sqrt(np.diagonal(poses.cov_position[0])), [0.013, 0.012, 0.021])


@pytest.mark.slow
def test_the_shift_of_one_line_stands_before_a_lever_arm_that_gains_less(flown, without_imu):
    """Oracle: 12 cm that the test adds north to the first line: of the explanations the one with
    the largest gain beyond its unknowns and what the best of three gains by chance is first.
    """
    done = adjust(block_of(flown, without_imu(shift=(19, 0.12))), write=False).solved
    found = trials(done, 0.0, lambda _: None)
    excess = [t.gain - t.unknowns - 2.0 * np.log(3.0) * ("line" in t.name) for t in found]
    assert found[0].name == "shift of the flight line from 8001.tif to 8019.tif"
    assert excess == sorted(excess, reverse=True)
    assert found[0].value[1] == pytest.approx(0.12, abs=0.06)


@pytest.mark.slow
def test_control_of_two_height_systems_is_named_first(flown, without_imu):
    """Oracle: half of the control is planted 0.3 m low; no datum, no lever arm is named."""
    directory = without_imu()
    head, *rows = (directory / "ground.csv").read_text().splitlines()
    table = [row.split(",") for row in rows]
    control = [row for row in table if row[-1] == "control"][::2]
    for row in control:
        row[3] = f"{float(row[3]) - 0.3:.4f}"
    (directory / "ground.csv").write_text("\n".join([head, *map(",".join, table)]) + "\n")
    done = adjust(block_of(flown, directory), write=False)
    first = done.judgement.trials_made[0]
    assert first.explains
    assert first.name.startswith(f"shift of {len(control)} of {len(table)} ground points")
    assert all(row[0] in first.name for row in control[:3])
    assert_allclose(first.value, (0.0, 0.0, -0.3), atol=4.5 * first.sigma.max())
    assert sum(trial.explains for trial in done.judgement.trials_made) == 1
    assert any("stand beside" in finding.advice for finding in done.judgement.findings)


@pytest.mark.slow
def test_a_wrong_ambiguity_of_one_line_leaves_no_orientation(flown, without_imu, tmp_path):
    """Oracle: 27 cm that the test adds to one of three lines; no eo.json without a telling name."""
    directory = without_imu(2, shift=(19, 0.27))
    block = block_of(flown, directory)
    done = adjust(block, tmp_path / "out")
    assert done.refusal is not None
    assert "shift of the flight line from 8001.tif to 8019.tif" in str(done.refusal)
    (line,) = [t for t in done.judgement.trials_made if t.name.startswith("shift of the flight")]
    assert abs(line.value[1] - 0.27) < 4.0 * line.sigma[1] < 0.2
    assert {entry.name for entry in (tmp_path / "out").iterdir()} == {"adjust.json", "adjust.html"}
    anyway = replace(block, adjustment=replace(block.adjustment, write_anyway=True))
    done = adjust(anyway, tmp_path / "out")
    assert done.refusal is not None
    assert (tmp_path / "out/contradicted/eo.json").is_file()
    assert not (tmp_path / "out/eo.json").exists()
    assert "earlier run" not in str(done.refusal)
    assert adjust(block_of(flown, without_imu(2)), tmp_path / "out", force=True).refusal is None
    again = adjust(block, tmp_path / "out", force=True)
    assert str(again.refusal).endswith("; the eo.json that lies there is of an earlier run")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("pattern", "changed", "words"),
    [
        (r"(\S+),Lat\t(\S+),Lon", r"\2,Lat\t\1,Lon", r"latitude and longitude exchanged"),
        (r"^(\d+)", lambda match: str(int(match[1]) + 1), r"had the pose of another: .*\+1 in the"),
    ],
)
def test_mistakes_in_a_list_of_positions_are_named(
    flown, without_imu, monkeypatch, pattern, changed, words
):
    """Oracle: what the test exchanges: latitudes with longitudes, each number with the next."""
    directory = without_imu()
    monkeypatch.setenv("INSGNSS_SHOWN", str(directory))
    path = directory / "Timestamp.MRK"
    path.write_text(re.sub(pattern, changed, path.read_text(), flags=re.MULTILINE))
    with pytest.raises((InputError, DataError), match=words):
        adjust(block_of(flown, directory), write=False)


@pytest.mark.parametrize("by_header", [False, True])
def test_ground_points_of_another_plane_are_placed(by_header, tmp_path):
    """Oracle: the points placed through their geodetic positions, and their covariance by hand, of
    a plane that is turned by half a degree of longitude."""
    origin = "origin 46.57 6.54 deg 12.5 m"
    path = tmp_path / "ground.csv"
    head = f"# tangent plane, {origin}\n" if by_header else ""
    path.write_text(f"{head}point,x,y,z,sigma_x,sigma_y,sigma_z\nG1,100,-50,20,0.03,0.01,0.02\n")
    ground, crs = ground_of(path, None)
    axes = GroundAxes(crs if by_header else origin)
    there, here = TangentPlane(*np.radians([46.57, 6.54]), 12.5), TangentPlane(0.8, 0.12, 400.0)
    placed = ground.in_plane(axes, here)
    X = here.position_from_geodetic(*there.geodetic_from_position(ground.position_m))
    assert_allclose(placed.position_m, X, atol=1e-4)
    R = here.C_em.T @ there.C_em
    assert_allclose(placed.cov[0], R @ np.diag([0.03, 0.01, 0.02]) ** 2 @ R.T, atol=1e-12)
    with pytest.raises(UsageError, match="need no geoid"):
        GroundAxes(origin, tmp_path / "geoid.gtx").geodetic(ground.position_m)
    with pytest.raises(UsageError, match="no origin of a tangent plane"):
        GroundAxes("origin 146.57 6.54 deg 0 m").geodetic(ground.position_m)


@pytest.mark.slow
def test_a_long_lever_arm_that_nobody_states_leaves_no_orientation(flown, without_imu):
    """Oracle: the planted lever arm, 0.4 m; a datum and a delay look alike."""
    done = adjust(block_of(flown, without_imu(3, (0.0, 0.0, -0.4))), write=False)
    refused = {one.name: one.found for one in done.judgement.refused}
    assert "shift of ground control" in refused.get("lever arm", ""), done.judgement.headline


def held_camera(flown, directory, tmp_path, factor):
    """Return a block whose camera is held, with its constant times a factor."""
    text = (flown.directory / BLOCK / "camera.toml").read_text()
    f_px = float(re.search(r"(?m)^f = ([\d.]+)", text)[1])
    camera_file = tmp_path / "camera.toml"
    camera_file.write_text(re.sub("(?m)^f = .*", f"f = {factor * f_px}", text))
    block = block_of(flown, directory)
    return replace(block, camera=replace(block.camera, file=camera_file, free=())), f_px


def of_camera(done):
    """Return what was tried of the camera."""
    return next(t for t in done.judgement.trials_made if t.name == "interior orientation")


@pytest.mark.slow
def test_a_held_camera_constant_is_named_though_the_lever_arm_takes_it(
    flown, without_imu, tmp_path
):
    """Oracles: the camera constant of the simulation, of which 0.1 % is taken off; an adjustment
    with the lever arm held, which nobody else stated."""
    block, f_px = held_camera(flown, without_imu(4), tmp_path, 0.999)
    done = adjust(block, write=False)
    instead = of_camera(done).in_place_of_arm
    assert instead.explains
    assert abs(instead.value[0] - 0.001 * f_px) < 4.5 * instead.sigma[0]
    (refused,) = (one.found for one in done.judgement.refused if one.name == "lever arm")
    assert "interior orientation" in refused, refused
    same = replace(block, adjustment=replace(block.adjustment, keep_all=True, reweight=("none",)))
    stated = replace(block.aerial_control, lever_arm_m=(0.0, 0.0, 0.0))
    instead = of_camera(adjust(same, write=False)).in_place_of_arm
    held = of_camera(adjust(replace(same, aerial_control=stated), write=False))
    assert_allclose((instead.value - held.value) / held.sigma, 0.0, atol=0.05)
    assert_allclose(instead.sigma, held.sigma, rtol=0.02)


@pytest.mark.slow
def test_a_lever_arm_is_not_taken_for_a_camera_that_is_held_and_right(flown, without_imu, tmp_path):
    """Oracle: the planted lever arm, 0.15 m; no cause is named without it."""
    block, _ = held_camera(flown, without_imu(4, (0.0, 0.0, -0.15)), tmp_path, 1.0)
    done = adjust(block, write=False)
    for one in done.judgement.findings:
        assert one.rank < 1.0 or "by a lever arm" in one.found, one.found
