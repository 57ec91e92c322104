"""Files that do not belong to each other: refused or told by name; a good block is neither."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pyproj import Transformer

from insgnss import read_eo
from insgnss.base.errors import DataError, InputError
from insgnss.cli.main import main
from insgnss.flight.config.block_file import BlockFile, GroundTableInput
from insgnss.geodesy.rotation import (
    CV_RUB,
    opk_from_rotation,
    rotation_from_opk,
    rotation_from_rpy,
    rotation_from_vector,
)
from insgnss.io.formats.blocks.camera_toml import read_camera_toml, write_camera_toml
from insgnss.io.formats.blocks.ground_points import (
    GroundTable,
    read_ground_points,
    write_ground_points,
)
from insgnss.io.formats.blocks.image_points import read_image_points, write_image_points
from insgnss.io.formats.orientation.eo_json import write_eo_json
from insgnss.photogrammetry.block_adjustment.aerial.relative import flight_lines
from insgnss.photogrammetry.block_adjustment.ground import ground_in_plane
from insgnss.photogrammetry.block_adjustment.inputs import inputs_of
from insgnss.photogrammetry.block_adjustment.judgement import _control
from insgnss.photogrammetry.block_adjustment.plausibility import (
    refuse_implausible,
    worse_than_stated,
)
from insgnss.photogrammetry.block_adjustment.residuals.check_points import CheckPoints
from insgnss.photogrammetry.block_adjustment.run import adjust
from insgnss.records.block import INTERIOR

BLOCK = "01_Observations/Camera/Block"
EO = "02_Processed/GPS-INS/eo.json"


def quiet(_: str) -> None:
    pass


@pytest.fixture
def copied(flown, tmp_path):
    return flown.copied(tmp_path / "flight")


@pytest.fixture(scope="session")
def right(flown):
    return inputs_of(flown.block, quiet)


def with_block(inputs, **changes):
    return replace(inputs, block=replace(inputs.block, **changes))


def with_poses(inputs, position=None, C=None):
    block = inputs.block
    return with_block(
        inputs,
        position_m=block.position_m if position is None else position,
        C_mc=block.C_mc if C is None else C,
    )


def with_pixels(inputs, change):
    seen, camera = inputs.block.observations, inputs.block.cameras[0]
    uv = change(np.array(seen.uv), np.array([camera.width, camera.height], dtype=float))
    changed = type(seen)(seen.image, seen.point, uv, seen.sigma_px)
    return with_block(inputs, observations=changed)


def with_camera(inputs, **values):
    (camera,) = inputs.block.cameras
    interior = np.array(camera.interior)
    for name, value in values.items():
        interior[INTERIOR.index(name)] = value
    return with_block(inputs, cameras=(replace(camera, interior=interior),))


def neighbours(inputs):
    """Each image has the pose of the next one."""
    block = inputs.block
    order = np.argsort(inputs.eo_row)
    source = np.empty_like(order)
    source[order] = np.roll(order, -1)
    return with_poses(inputs, block.position_m[source], block.C_mc[source])


def broken(missed, first, end=None, turn_deg=0.0):
    """From a row of the order of time on, each image has the pose of the one `missed` after it; of
    none the order is reversed, or the attitudes are turned."""

    def plant(inputs):
        block, order = inputs.block, np.argsort(inputs.eo_row)
        rows = order[first:end]
        position, C = block.position_m.copy(), block.C_mc.copy()
        if turn_deg:
            C[rows] = rotation_from_vector(np.radians([0.0, 0.0, turn_deg])) @ C[rows]
        else:
            source = rows[::-1] if not missed else np.append(rows[missed:], rows[-missed:])
            position[rows], C[rows] = block.position_m[source], block.C_mc[source]
        return with_poses(inputs, position, C)

    return plant


def lines_of(inputs):
    """First and last rows of the flight lines, in the order of time."""
    return [(int(r[0]), int(r[-1]) + 1) for r in flight_lines(inputs.eo) if r.size > 8]


def exchanged(inputs):
    rows = np.arange(len(inputs.block.images))
    rows[[4, 9]] = rows[[9, 4]]
    return with_poses(inputs, inputs.block.position_m[rows], inputs.block.C_mc[rows])


def delayed(inputs):
    eo, rows = inputs.eo, inputs.eo_row
    C = rotation_from_vector(-eo.rate_radps[rows]) @ inputs.block.C_mc
    return with_poses(inputs, inputs.block.position_m - eo.velocity_mps[rows], C)


def reversed_angles(inputs):
    opk = opk_from_rotation(inputs.block.C_mc @ CV_RUB)
    return with_poses(inputs, C=rotation_from_rpy(opk) @ CV_RUB)


def with_ground(inputs, change):
    block = inputs.block
    both = {
        kind: replace(points, position_m=change(np.array(points.position_m)))
        for kind, points in (("control", block.control), ("check", block.check))
    }
    return with_block(inputs, **both)


CASES = {
    "y mirrored": (
        lambda i: with_pixels(i, lambda uv, s: np.column_stack([uv[:, 0], s[1] - uv[:, 1]])),
        "y counted upwards",
    ),
    "x mirrored": (
        lambda i: with_pixels(i, lambda uv, s: np.column_stack([s[0] - uv[:, 0], uv[:, 1]])),
        "x counted from the right",
    ),
    "turned by 180 deg": (
        lambda i: with_pixels(i, lambda uv, s: s - uv),
        r"turned by \+180 deg about its z axis",
    ),
    "right up back": (
        lambda i: with_poses(i, C=i.block.C_mc @ CV_RUB),
        r"turned by \+180 deg about its x axis",
    ),
    "transposed": (
        lambda i: with_poses(i, C=np.ascontiguousarray(i.block.C_mc.swapaxes(1, 2))),
        "transposed",
    ),
    "angles composed backwards": (
        reversed_angles,
        "order omega phi kappa .*as kappa phi omega",
    ),
    "degrees for radians": (
        lambda i: with_poses(
            i,
            C=rotation_from_opk(np.degrees(opk_from_rotation(i.block.C_mc @ CV_RUB))) @ CV_RUB,
        ),
        "none of .* fits; .*another flight.*degrees for radians",
    ),
    "named as neighbours": (neighbours, r"each image had the pose of another.*\(-1 in the order"),
    "two exchanged": (exchanged, r"80\d\d.tif and 80\d\d.tif .* when the two are exchanged"),
    "a second late": (delayed, r"a delay of \+1.00 s"),
    "principal point from the middle": (
        lambda i: with_camera(i, cx=30.4, cy=51.9),
        "cx and cy, the principal point, counted from the middle",
    ),
    "easting and northing": (
        lambda i: with_ground(i, lambda X: X[:, [1, 0, 2]]),
        "easting and northing exchanged",
    ),
    "feet": (lambda i: with_ground(i, lambda X: X / 0.3048), "in feet"),
    "heights downwards": (
        lambda i: with_ground(i, lambda X: X * [1, 1, -1]),
        "height with the other sign",
    ),
    "geoid": (
        lambda i: with_ground(i, lambda X: X - [0.0, 0.0, 50.0]),
        r"all of them alike, by [+-]0.\d, [+-]0.\d, -50.0 m; heights above .* \(geoid\)",
    ),
    "every second without geoid": (
        lambda i: with_ground(i, lambda X: X - [[0.0, 0.0, 48.0 * (k % 2)] for k in range(len(X))]),
        r"\d of 15 ground points \(G02, G04, .*\) lie [+-]0.\d, [+-]0.\d, -4[78].\d m .*geoid",
    ),
    "ground points of another place": (
        lambda i: with_ground(i, lambda X: X[::-1] * [1.7, -0.6, 1.0]),
        "check ground.crs and the names",
    ),
}


QUICK = ("y mirrored", "named as neighbours", "a second late", "feet", "geoid")


@pytest.mark.parametrize(
    "case", [pytest.param(c, marks=() if c in QUICK else pytest.mark.slow) for c in CASES]
)
def test_what_does_not_belong_is_refused_by_name(case, right) -> None:
    """Oracle: what was planted."""
    plant, message = CASES[case]
    with pytest.raises(DataError, match=message):
        refuse_implausible(plant(right))


def test_a_poor_first_attitude_is_refused_only_where_the_adjustment_failed(right) -> None:
    """Oracle: one attitude turned by 40 deg: an observation of an eo.json, a first value else."""
    C = right.block.C_mc.copy()
    C[6] = C[6] @ rotation_from_vector(np.radians([0.0, 40.0, 0.0]))
    turned = with_poses(right, right.block.position_m, C)
    named = re.escape(right.block.images[6])
    with pytest.raises(DataError, match=named):
        refuse_implausible(turned)
    control = replace(right.file.aerial_control, file=Path("Timestamp.MRK"), control="Ap")
    alone = replace(turned, file=replace(right.file, aerial_control=control))
    refuse_implausible(alone)
    with pytest.raises(DataError, match=named):
        refuse_implausible(alone, failed=True)


@pytest.mark.parametrize(
    ("missed", "whole", "turn_deg", "words"),
    [
        (1, False, 0.0, r"each of the images {0} to {1} had the position of the image 1 after it"),
        (2, False, 0.0, r"each of the images {0} to {1} had the position of the image 2 after it"),
        (1, True, 0.0, r"each of the images {0} to {1} had the position of the image 1 after it"),
        (0, True, 0.0, r"images {0} to {1}, a flight line, were numbered in the reverse order"),
        (0, True, 180.0, r"attitudes of images {0} to {1}, a flight line, .* by 180 deg"),
        (0, True, 90.0, r"attitudes of images {0} to {1}, a flight line, .* by 90 deg"),
    ],
)
def test_the_image_at_which_an_order_breaks_is_named(missed, whole, turn_deg, words, right) -> None:
    """Oracle: the image from which on the test shifts poses by one or two, or the line whose order
    or attitudes it turns."""
    n = len(right.eo.images)
    first, end = lines_of(right)[1] if whole else (23, n)
    first += 3 * (whole and missed > 0)
    named = (right.eo.images[first], right.eo.images[end - 1])
    with pytest.raises(DataError, match=words.format(*map(re.escape, named))):
        refuse_implausible(broken(missed, first, end, turn_deg)(right))


def two_of_five(inputs, seed):
    """Five images with poses wrong by some deg; the first two have those of the last two."""
    draw = np.random.default_rng(seed)
    order = np.argsort(inputs.eo_row)[:5]
    position, C = inputs.block.position_m.copy(), inputs.block.C_mc.copy()
    C[order] = C[order] @ rotation_from_vector(np.radians(3.0 * draw.standard_normal((5, 3))))
    position[order[:2]] = inputs.block.position_m[order[3:]]
    C[order[:2]] = inputs.block.C_mc[order[3:]]
    wrong = with_poses(inputs, position, C)
    seen = wrong.block.observations
    keep = np.isin(seen.image, order)
    parts = (seen.image, seen.point, seen.uv, seen.sigma_px)
    block = with_block(wrong, observations=type(seen)(*(part[keep] for part in parts)))
    return replace(block, eo=replace(inputs.eo, cov=1e-4 * inputs.eo.cov))


@pytest.mark.parametrize("seed", range(3))
def test_few_images_that_do_not_fit_are_not_blamed_on_their_names(seed, right) -> None:
    """Oracle: shifted by three only two of five images fit, which is no order of names."""
    few = two_of_five(right, seed)
    refuse_implausible(few, failed=True)
    assert re.search(
        r"rays of a point miss each other by \d+\.\d px, .* stated sigmas", worse_than_stated(few)
    )
    assert worse_than_stated(right) == ""


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_a_block_that_fails_for_another_reason_is_not_blamed_on_a_reading(seed, right) -> None:
    """Oracle: nothing is wrong with axes, names, camera; pixels are good to 3 px."""
    draw = np.random.default_rng(seed)
    refuse_implausible(
        with_pixels(right, lambda uv, s: uv + 3.0 * draw.standard_normal(uv.shape)), failed=True
    )


def test_good_and_tolerable_blocks_pass(right) -> None:
    """Oracle: nothing is wrong, or what an adjustment estimates: bore-sight, camera constant."""
    turn = rotation_from_vector(np.radians([4.0, -3.0, 6.0]))
    (camera,) = right.block.cameras
    free = replace(camera, free=("f", "cx", "cy"))
    for inputs in (
        right,
        with_poses(right, C=right.block.C_mc @ turn),
        with_camera(with_block(right, cameras=(free,)), f=1.2 * camera.of("f")),
        with_pixels(right, lambda uv, s: uv - 0.5),
    ):
        refuse_implausible(inputs)
    held = with_block(right, cameras=(replace(camera, free=()),))
    with pytest.raises(DataError, match="camera constant does not fit"):
        refuse_implausible(with_camera(held, f=1.2 * camera.of("f")))


def test_too_little_to_go_by(right) -> None:
    """Oracle: of two images nothing is said, whatever their pixels are."""
    mirrored = with_pixels(right, lambda uv, s: np.column_stack([uv[:, 0], s[1] - uv[:, 1]]))
    seen = mirrored.block.observations
    few = seen.image < 2
    changed = type(seen)(seen.image[few], seen.point[few], seen.uv[few], seen.sigma_px[few])
    refuse_implausible(with_block(mirrored, observations=changed))


def test_one_image_is_named(right) -> None:
    """Oracle: the image whose observations are of another scene."""
    seen = right.block.observations
    mine = seen.image == 7
    draw = np.random.default_rng(3)
    uv = np.where(mine[:, None], draw.uniform(0.0, 3800.0, seen.uv.shape), seen.uv)
    name = right.block.images[7]
    with pytest.raises(DataError, match=rf'observations of {name} do .* images.skip = \["{name}"'):
        refuse_implausible(with_pixels(right, lambda *_: uv))


@pytest.mark.parametrize("height_m", [6.0, 8.0])
def test_ground_points_that_are_all_off_are_not_called_some(height_m, right) -> None:
    """Oracle: the test shifts all of them by little more than the distance that is asked about."""
    with pytest.raises(DataError, match="and all of them alike"):
        refuse_implausible(with_ground(right, lambda X: X - [0.0, 0.0, height_m]))


@pytest.mark.parametrize(
    ("off_m", "alone"), [((0.0, 0.0, 0.0), None), ((0.4, 0.0, 0.0), 1), ((0.4, 0.4, 0.0), None)]
)
def test_one_check_point_contradicts_alone(off_m, alone) -> None:
    """Oracle: how far the test puts each of three check points whose sigmas are 2 cm."""
    d = np.array([[0.01, -0.01, 0.02], [0.0, 0.01, -0.01], [0.01, 0.0, 0.01]])
    d[[1, 2, 0], 0] += off_m
    checks = CheckPoints(np.arange(3), d, 4e-4 * np.eye(9), np.zeros((3, 3, 3)))
    assert checks.contradicts_alone == alone


def test_two_ground_points_are_named(right) -> None:
    """Oracle: the points that have each other's coordinates."""
    control = right.block.control
    rows = np.arange(len(control))
    rows[[1, 2]] = rows[[2, 1]]
    moved = replace(control, position_m=control.position_m[rows])
    names = [right.block.points[p] for p in control.point[[1, 2]]]
    with pytest.raises(DataError, match=f"ground points {names[0]} and {names[1]} lie"):
        refuse_implausible(with_block(right, control=moved))


UNITS = {
    "millimetres": (lambda uv, s: 0.0039 * uv, "look like millimetres"),
    "from the middle": (lambda uv, s: uv - s / 2, "as if they counted from the middle"),
    "exchanged": (lambda uv, s: uv[:, ::-1], "as if x and y were exchanged"),
    "negative": (lambda uv, s: uv * [1, -1], "as if y counted upwards"),
    "of half the size": (lambda uv, s: 2.0 * uv, "an image of 2 times the size"),
    "of twice the size": (lambda uv, s: 0.5 * uv, "upper left quarter"),
}


@pytest.mark.parametrize("case", UNITS)
def test_pixels_beside_the_image_say_as_what_they_would_fit(case, copied) -> None:
    """Oracle: what was done to the coordinates."""
    change, message = UNITS[case]
    path = copied.directory / BLOCK / "image_points.csv"
    table = read_image_points(path)
    seen = table.observations
    uv = change(np.array(seen.uv), np.array([5120.0, 3840.0]))
    changed = type(seen)(seen.image, seen.point, uv, seen.sigma_px)
    write_image_points(replace(table, observations=changed), path)
    with pytest.raises(InputError, match=message):
        inputs_of(copied.block, quiet)


def test_units_and_names_of_other_files(copied) -> None:
    """Oracle: what was done to the camera, the names, the coordinates, the header."""
    folder = copied.directory / BLOCK
    camera = read_camera_toml(folder / "camera.toml")
    write_camera_toml(
        replace(camera, interior=np.array([21.9, *camera.interior[1:]])), folder / "camera.toml"
    )
    with pytest.raises(InputError, match=r"camera constant f 21.9 px sees 17\d deg"):
        inputs_of(copied.block, quiet)
    write_camera_toml(camera, folder / "camera.toml")
    table = (folder / "image_points.csv").read_text()
    (folder / "image_points.csv").write_text(table.replace("\n8", "\nDSC8"))
    with pytest.raises(InputError, match="no image of the image observations is in the orient"):
        inputs_of(copied.block, quiet)
    rows = [",".join(row.split(",")[:3]) for row in table.splitlines()[1:]]
    (folder / "image_points.csv").write_text("\n".join(rows))
    with pytest.raises(InputError, match=r"image_points.csv:1: .* does not name y"):
        inputs_of(copied.block, quiet)


def test_points_seen_once_are_counted(copied) -> None:
    """Oracle: every tie point has a name of its own in each image."""
    path = copied.directory / BLOCK / "image_points.csv"
    head, *rows = path.read_text().splitlines()[1:]
    split = [row.split(",") for row in rows]
    new = [",".join([i, p if p.startswith("G") else f"{p}_{i}", *rest]) for i, p, *rest in split]
    path.write_text("\n".join([head, *new, ""]))
    ties = sum(not p.startswith("G") for _, p, *_ in split)
    (note,) = [n for n in inputs_of(copied.block, quiet).notes if "measured once" in n]
    assert note.startswith(f"{ties} of ")


FEET = "+proj=utm +zone=32 +datum=WGS84 +units=us-ft"


@pytest.mark.parametrize(
    ("crs", "factors", "why"),
    [
        ("EPSG:32632", (1 / 0.3048, 1 / 0.3048), "there if their numbers are feet: name the CRS"),
        (FEET, (1.0, 1.0), "there if their numbers are metres: name the CRS"),
        ("EPSG:32631", (1.0, 1.0), "EPSG:32631 is not their CRS; their numbers fit EPSG:32632"),
        (None, (1.0, 1.0), "name it by ground.crs or --crs, their numbers fit EPSG:32632"),
        ("EPSG:32631", (9.0, 1.0), "EPSG:32631 is not their CRS; name the right one"),
        ("EPSG:32632", None, "with easting and northing exchanged: exchange the columns"),
    ],
)
def test_ground_points_of_another_unit_or_zone(crs, factors, why, right, tmp_path) -> None:
    """Oracle: pyproj's UTM coordinates of the site, written in the unit or order that is named."""
    lat, lon, _ = np.degrees(right.eo.origin)
    e, n = Transformer.from_crs("EPSG:4326", "EPSG:32632", always_xy=True).transform(lon, lat)
    x = np.array([n, e, 400.0]) if factors is None else np.array([e, n, 400.0]) * (*factors, 1.0)
    one = GroundTable(("G",), x[None], np.eye(3)[None], np.zeros(1, dtype=bool))
    write_ground_points(one, path := tmp_path / "gcp.csv")
    file = BlockFile(path=path, ground=GroundTableInput(file=path, crs=crs))
    with pytest.raises(InputError, match=re.escape(why)):
        ground_in_plane(file, None, right.eo, [])


@pytest.mark.parametrize(
    ("crs", "factors", "terms", "why"),
    [
        ("EPSG:32632", (1.0, 1.0, 1.0), (-3e5, -5.1e6, 0.0), "if 300000 5100000 were subtracted"),
        ("EPSG:32632", (1.0, 1.0, 1.0), (32e6, 0.0, 0.0), "if -32000000 0 were subtracted"),
        ("EPSG:32632", (1.0, 1.0, 1.0), (-5e5, 0.0, 0.0), "if 500000 0 were subtracted"),
        ("EPSG:32632", (1e-3, 1e-3, 1.0), (0.0, 0.0, 0.0), "are kilometres: write metres"),
        ("EPSG:32632", (1.0, 1.0, 1e3), (0.0, 0.0, 0.0), "are 400 km in metres"),
        ("EPSG:4326", (1.0, 1.0, 1e3), (0.0, 0.0, 0.0), "are 400 km in metres"),
        ("EPSG:4326", (1 / 0.9, 1 / 0.9, 1.0), (0.0, 0.0, 0.0), "are gon: write degrees"),
        ("EPSG:4326", (np.pi / 180, np.pi / 180, 1.0), (0.0, 0.0, 0.0), "are radians: write deg"),
        ("EPSG:4326", (), (0.0, 0.0, 0.0), "with longitude and latitude exchanged"),
        (None, (1.0, 1.0, 1.0), (0.0, 0.0, 0.0), "its x and y are degrees"),
    ],
)
def test_ground_points_of_another_scale_or_shift(crs, factors, terms, why, right, tmp_path) -> None:
    """Oracle: what was done to pyproj's coordinates of the site."""
    lat, lon, _ = np.degrees(right.eo.origin)
    x = np.array([[lon, lat, 400.0], [lon + 1e-3, lat + 1e-3, 400.0]])
    if crs == "EPSG:32632":
        to_map = Transformer.from_crs("EPSG:4326", crs, always_xy=True)
        x = np.column_stack(to_map.transform(*x.T))
    x = x * factors + terms if factors else x[:, [1, 0, 2]]
    (path := tmp_path / "gcp.csv").write_text("point,x,y,z,sigma_x,sigma_y,sigma_z\n")
    with path.open("a") as stream:
        for name, (e, n, h) in zip("GH", x.tolist(), strict=True):
            stream.write(f"{name},{e:.9f},{n:.9f},{h:.4f},0.01,0.01,0.01\n")
    file = BlockFile(path=path, ground=GroundTableInput(file=path, crs=crs))
    with pytest.raises(InputError, match=re.escape(why)):
        ground_in_plane(file, None, right.eo, [])


def shifted_ground(copied, metres) -> None:
    path = copied.directory / BLOCK / "ground_points.csv"
    ground = read_ground_points(path)
    write_ground_points(replace(ground, position_m=ground.position_m + metres), path)


@pytest.mark.slow
def test_a_large_contradiction_leaves_no_orientation(copied, capsys) -> None:
    """Oracle: a shift of half a metre of all ground points, which is named; exit 4, no eo.json."""
    shifted_ground(copied, [0.4, -0.3, 0.0])
    out = copied.directory / "02_Processed/Adjustment"
    for path in out.glob("*"):
        path.unlink()
    assert main(["adjust", str(copied.directory / "block.toml"), "-q"]) == 4
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert re.search(r"shift of ground control of \+(39|40)\d / -(29|30)\d /", error)
    assert "no orientation is written" in error
    assert {path.name for path in out.iterdir()} == {"adjust.json", "adjust.html"}
    accept = '\n[adjustment]\naccept = ["ground control", "check points"]\n'
    path = copied.directory / "block.toml"
    path.write_text(path.read_text() + accept)
    assert main(["adjust", str(path), "-q"]) == 0
    assert "\nBad: " in capsys.readouterr().out
    assert (out / "eo.json").is_file()


@pytest.mark.slow
def test_a_lever_arm_that_hides_in_the_bore_sight_is_told(copied) -> None:
    """Oracle: 20 cm along the flight, which no variance component shows."""
    eo = read_eo(copied.directory / EO)
    moved = eo.position_m + eo.C_mc @ np.array([0.0, 0.2, 0.0])
    write_eo_json(replace(eo, position_m=moved), copied.directory / EO)
    result = adjust(copied.block, write=False)
    assert result.judgement.contradicted
    assert "unmodelled lever arm of " in result.judgement.headline
    (trial,) = [t for t in result.judgement.trials_made if t.name == "lever arm"]
    assert abs(trial.value[1] - 0.2) < 4.0 * trial.sigma[1] < 0.2


def test_a_shift_of_check_points_is_found_with_its_covariance() -> None:
    """Oracle: least squares by hand, of points that share most of their error."""
    draw = np.random.default_rng(8)
    A = draw.standard_normal((12, 12))
    P = A @ A.T + np.kron(np.ones((4, 4)), np.eye(3))
    d = np.tile([1.0, -2.0, 3.0], (4, 1))
    checks = CheckPoints(np.arange(4), d, P, np.zeros((4, 3, 3)))
    value, cov = checks.shift()
    H = np.vstack([np.eye(3)] * 4)
    assert value == pytest.approx([1.0, -2.0, 3.0])
    assert cov == pytest.approx(np.linalg.inv(H.T @ np.linalg.inv(P) @ H))


def test_a_control_point_that_nothing_else_observes_is_named_without_a_residual() -> None:
    """Oracle: the figures by hand: there is no residual where no image observation is left."""
    points = [{"point": "G1", "residual_m": [None] * 3, "w": 8.0}]
    (finding,) = _control({"rejected_ground_control": points})
    assert "ground control point G1 does not fit and was left out: 8.0 sigma" in finding.sentence
