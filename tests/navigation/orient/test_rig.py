"""Several cameras on one body: where each stands and looks, what its images share, and what the
formats make of it.
"""

import json
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from insgnss.base.errors import InputError, UsageError
from insgnss.flight.exporting.export import export
from insgnss.geodesy.frames import TangentPlane
from insgnss.io.formats.orientation import eo_packed
from insgnss.io.formats.orientation.eo_json import read_eo_json, read_one_camera, write_eo_json
from insgnss.io.options.camera_options import CameraInput, CameraMounting
from insgnss.navigation.orient.exterior import exterior_orientation
from insgnss.navigation.orient.frame import in_frame
from insgnss.navigation.orient.relative import GyroFigures, relative_control
from insgnss.navigation.orient.rig import rig_orientation
from insgnss.records import CameraEvents, ExteriorOrientation, Trajectory
from insgnss.records.cameras.mounting import Mounting
from insgnss.records.cameras.rig import merged_order

MICROMETRE, MICRORADIAN = 1e-6, 1e-6
PLANE = TangentPlane(np.radians(46.57), np.radians(6.54), 400.0)
GYRO = GyroFigures(1e-4, 1e-5)
NADIR = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
# forward and 45 deg down: the image's right is the body's right
OBLIQUE = Rotation.from_euler("x", 45.0, degrees=True).as_matrix() @ np.array(
    [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]
)
FIRST = Mounting(
    antenna_m=[0.1, -0.2, -0.9],
    imu_m=[0.12, 0.03, -0.2],
    camera_from_body=NADIR,
    boresight=Rotation.from_euler("XYZ", [0.6, -0.9, 1.2], degrees=True).as_matrix(),
)
OFFSET_M = (0.35, -0.12, 0.07)
FURTHER = CameraMounting(
    from_camera_m=OFFSET_M, camera_from_body=OBLIQUE, boresight_deg=("opk", (0.4, -0.3, 0.2))
)
PINHOLE = "PINHOLE 4000 3000 3000 3000 2000 1500"


def at_instants(n: int, start: float = 100.0) -> Trajectory:
    """A body that flies north-east, each instant a second after the one before, with any
    covariance.
    """
    draw = np.random.default_rng(3)
    enu = np.column_stack([10.0 * np.arange(n), 10.0 * np.arange(n), np.full(n, 120.0)])
    lat, lon, h = PLANE.geodetic_from_position(enu)
    C_nb = Rotation.from_euler(
        "ZYX", np.column_stack([np.full(n, 45.0), draw.normal(0.0, 3.0, (n, 2))]), degrees=True
    ).as_matrix()
    L = draw.normal(size=(n, 9, 9)) * np.repeat([0.02, 0.02, 2e-4], 3)[:, None]
    cov = L @ L.swapaxes(1, 2)
    still = np.zeros((n, 3))
    return Trajectory(
        *(start + np.arange(n), lat, lon, h, still, C_nb, cov, 2000),
        rate_b=still,
        cross=0.5 * cov[:-1],
    )


def rig(n: int = 4) -> ExteriorOrientation:
    """Two cameras of one trigger."""
    body, mountings = at_instants(n), (FIRST, FURTHER.on(FIRST))
    cameras = [
        exterior_orientation(
            body,
            CameraEvents(tuple(f"{name}{k}.jpg" for k in range(n)), body.time, 2000),
            mounting,
            PLANE,
        )
        for name, mounting in zip("ab", mountings, strict=True)
    ]
    order, number = merged_order([eo.time for eo in cameras])
    of_camera = np.zeros((2 * n, 6, 6))
    for k, eo in enumerate(cameras):
        of_camera[np.flatnonzero(number == k)[:-1]] = eo.cross
    in_time = np.zeros((2 * n - 1, 6, 6))
    in_time[0::2] = 0.9 * cameras[0].cov
    return rig_orientation(cameras, ("nadir", "forward"), order, number, (in_time, of_camera))


def test_an_oblique_camera_stands_and_looks_where_the_rotations_by_hand_say() -> None:
    """Oracle: scipy's Rotations composed by hand: body, nominal turn, bore-sight, offset in the
    axes of the first camera.
    """
    body = at_instants(3)
    eo = rig(3).of_camera("forward")
    to_body = Rotation.from_matrix(FIRST.boresight).inv() * Rotation.from_matrix(NADIR).inv()
    place_b = to_body.apply(-FIRST.imu_m) + to_body.apply(OFFSET_M)
    turn = Rotation.from_matrix(OBLIQUE) * Rotation.from_euler("XYZ", [0.4, -0.3, 0.2], True)
    C_mn = PLANE.C_mn(body.lat, body.lon)
    origins = PLANE.position_from_geodetic(body.lat, body.lon, body.height)
    for k in range(3):
        to_plane = Rotation.from_matrix(C_mn[k]) * Rotation.from_matrix(body.C_nb[k])
        centre = origins[k] + to_plane.apply(place_b)
        assert_allclose(eo.position_m[k], centre, rtol=0, atol=1e-3 * MICROMETRE)
        camera = (to_plane * turn.inv()).as_matrix()
        assert_allclose(eo.C_mc[k], camera, rtol=0, atol=1e-3 * MICRORADIAN)
        assert camera[2, 2] < -0.6  # it looks down by 45 deg


def test_the_antenna_stays_where_the_first_camera_has_it() -> None:
    """Oracle: the lever arm IMU to antenna in body axes, whichever way the place is given."""
    by_offset = FURTHER.on(FIRST)
    by_imu = replace(FURTHER, from_camera_m=None, imu_m=tuple(by_offset.imu_m)).on(FIRST)
    for other in (by_offset, by_imu):
        assert_allclose(other.antenna_lever_b, FIRST.antenna_lever_b, rtol=0, atol=1e-12)
        assert_allclose(other.camera_lever_b, by_offset.camera_lever_b, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("camera", "message"),
    [
        ({"further": (CameraInput(events=None, name="camera_1"),)}, "names two cameras"),
        ({"name": "left side"}, "no name of letters"),
    ],
)
def test_cameras_have_names_of_their_own(camera, message) -> None:
    """Oracle: the page of the flight file."""
    with pytest.raises(UsageError, match=message):
        CameraInput(events=None, **camera)
    with pytest.raises(UsageError, match="from_camera_m is given as well"):
        CameraMounting(from_camera_m=OFFSET_M, imu_m=OFFSET_M)


def test_one_camera_of_a_rig_is_as_if_it_had_flown_alone() -> None:
    """Oracle: the orientation of that camera by itself, bit by bit."""
    body, eo = at_instants(4), rig(4)
    events = CameraEvents(("b0.jpg", "b1.jpg", "b2.jpg", "b3.jpg"), body.time, 2000)
    alone = exterior_orientation(body, events, FURTHER.on(FIRST), PLANE)
    assert eo.images[:3] == ("a0.jpg", "b0.jpg", "a1.jpg")
    own = eo.of_camera("forward")
    for name in ("time", "position_m", "C_mc", "cov", "cross", "boresight", "camera_from_body"):
        assert_array_equal(getattr(own, name), getattr(alone, name))
    assert own.rig is None
    with pytest.raises(InputError, match="'left' is none of the rig; it has nadir, forward"):
        eo.of_camera("left")
    with pytest.raises(InputError, match="all of one camera"):
        own.of_camera("forward")


def test_a_choice_of_images_keeps_what_its_neighbours_share() -> None:
    """Oracle: by hand: neighbours in time, of a camera, and images that are neither."""
    eo = rig(4)
    part = eo[2:6]
    assert_array_equal(part.cross, eo.cross[2:5])
    assert_array_equal(part.rig.cross[:2], eo.rig.cross[2:4])
    assert not part.rig.cross[2:].any()
    assert eo[[0, 3]].cross is None
    assert eo[[0, 4]].cross is None
    assert eo[[0, 4]].rig.cross is None
    assert eo.rig.of_images == ["nadir", "forward"] * 4


def test_relative_control_is_that_of_each_camera_by_itself() -> None:
    """Oracle: the relative control of both cameras alone, whose lines follow each other."""
    eo = rig(5)
    whole = relative_control(in_frame(eo, "tangent plane"), GYRO)
    rows = 0
    for name in eo.rig.names:
        own = relative_control(in_frame(eo.of_camera(name), "tangent plane"), GYRO)
        pairs = slice(rows, rows + own.i.size)
        assert [whole.names[k] for k in range(*pairs.indices(99))] == own.names
        for field in ("offset", "rotation", "smoothed", "independent", "gyro"):
            assert_array_equal(getattr(whole, field)[pairs], getattr(own, field))
        rows += own.i.size
    assert rows == whole.i.size == 8
    assert whole.line.tolist() == [1] * 4 + [2] * 4


@pytest.mark.parametrize("many", [False, True])
def test_the_master_holds_the_cameras(tmp_path, monkeypatch, many) -> None:
    """Oracle: what was written; the reader of one camera says how to get it."""
    if many:
        monkeypatch.setattr(eo_packed, "FROM_IMAGES", 4)
    eo, path = rig(4), tmp_path / "eo.json"
    write_eo_json(eo, path)
    again = read_eo_json(path)
    assert again.images == eo.images
    assert again.rig.names == ("nadir", "forward")
    assert_array_equal(again.rig.number, eo.rig.number)
    assert_array_equal(again.rig.cross, eo.rig.cross)
    assert_array_equal(again.rig.C_cb, eo.rig.C_cb)
    assert json.loads(path.read_text())["format_version"] == 3
    with pytest.raises(InputError, match=r"2 cameras .*export eo\.json eo_json --camera nadir"):
        read_one_camera(path, "an adjustment")
    write_eo_json(eo.of_camera("forward"), path)
    assert read_one_camera(path, "an adjustment").images[0] == "b0.jpg"


def test_a_master_whose_images_name_no_camera_is_refused(tmp_path) -> None:
    """Oracle: data_specs/eo_json.md."""
    path = tmp_path / "eo.json"
    write_eo_json(rig(3), path)
    content = json.loads(path.read_text())
    for change, message in (
        ({"camera": "left"}, "camera 'left' is not listed in cameras"),
        ({"time_s": 99.0}, "its time does not follow"),
    ):
        content_now = json.loads(json.dumps(content))
        content_now["images"][2].update(change)
        path.write_text(json.dumps(content_now))
        with pytest.raises(InputError, match=message):
            read_eo_json(path)


def test_formats_keep_the_cameras_apart(tmp_path) -> None:
    """Oracle: the files by eye: camera numbers, sensors and photogroups follow the images."""
    eo = rig(3)
    export(eo, "colmap", tmp_path / "colmap", camera=f"nadir={PINHOLE}; forward={PINHOLE}")
    lines = (tmp_path / "colmap/images.txt").read_text().splitlines()
    images = [line.split() for line in lines if line and not line.startswith("#")]
    assert [(words[8], words[9]) for words in images][:3] == [
        ("1", "a0.jpg"),
        ("2", "b0.jpg"),
        ("1", "a1.jpg"),
    ]
    assert len((tmp_path / "colmap/cameras.txt").read_text().splitlines()) == 3
    export(eo, "bentley", tmp_path / "blocks.xml")
    groups = (tmp_path / "blocks.xml").read_text().split("<Photogroup>")[1:]
    assert [g[: g.index("</")] for g in groups] == ["<Name>nadir", "<Name>forward"]
    assert "a0.jpg" in groups[0]
    assert "b0.jpg" not in groups[0]
    export(eo, "metashape_offset", tmp_path / "offset.csv")
    text = (tmp_path / "offset_gps_ins_offset.txt").read_text()
    assert "nadir: X, Y, Z" in text
    assert "forward: X, Y, Z" in text
    export(eo, "eo_local_plane", tmp_path / "EO.txt")
    rows = [x for x in (tmp_path / "EO.txt").read_text().splitlines() if not x.startswith("#")]
    assert [row.split()[0] for row in rows] == list(eo.images)


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("inpho_prj", {"focal_mm": 35.0, "ground_m": 400.0}, "focal_mm holds for one camera"),
        ("colmap", {"camera": f"nadir={PINHOLE}"}, "camera 'forward' is missing"),
        ("colmap", {"camera": f"left={PINHOLE}"}, "'left' is not in the orientation"),
        ("colmap", {"camera": f"nadir={PINHOLE};nadir={PINHOLE}"}, "'nadir' stands twice"),
    ],
)
def test_what_is_of_one_camera_is_refused_of_several(tmp_path, name, options, message) -> None:
    """Oracle: sentences written by hand."""
    with pytest.raises(UsageError, match=message):
        export(rig(3), name, tmp_path / "x", **options)
