"""Camera poses of any format, and antenna positions, in one frame."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from test_similarity_files import ARM, Flown

import insgnss
from insgnss.base.errors import InputError
from insgnss.geodesy.frames import TangentPlane
from insgnss.io.formats.blocks.ground_points import GroundAxes, GroundTable
from insgnss.photogrammetry.mounting_calibration.intersections import surveyed_points
from insgnss.photogrammetry.mounting_calibration.options import PlaceOptions
from insgnss.photogrammetry.mounting_calibration.poses import join_by_name, read_camera_poses
from insgnss.photogrammetry.mounting_calibration.records import CameraPoses

ORIGIN = np.array([np.radians(46.57), np.radians(6.54), 0.0])
FORMATS = {
    "eo_json": {},
    "metashape": {},
    "metashape_opk": {},
    "eo_local_plane": {},
    "generic_ascii": {},
    "colmap": {"camera": "PINHOLE 5472 3648 3600 3600 2736 1824"},
}


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    """The simulated strips as an exterior orientation, and their antenna positions."""
    flown, directory = Flown(), tmp_path_factory.mktemp("flight")
    R = flown.axes
    n = len(flown.C)
    cov = np.diag([9e-6] * 3 + [1e-12] * 3)
    eo = insgnss.ExteriorOrientation(
        images=tuple(f"I{k}.jpg" for k in range(n)),
        time=1000.0 + 1.5 * np.arange(n),
        gps_week=2008,
        position_m=flown.centres @ R.T * flown.scale + flown.T,
        C_mc=R @ flown.C,
        cov=np.broadcast_to(cov, (n, 6, 6)).copy(),
        cross=np.zeros((n - 1, 6, 6)),
        origin=ORIGIN,
        boresight=np.eye(3),
        camera_from_body=np.diag([-1.0, -1.0, 1.0]),
    )
    flown.write(directory)
    return directory, eo


@pytest.mark.parametrize("form", FORMATS)
def test_poses_of_any_format_give_the_same_lever_arm(flight, tmp_path, form) -> None:
    """Oracle: the lever arm of the simulation; formats by their own writers, which other tests hold
    against their programs.
    """
    if form == "colmap":
        pytest.importorskip("pycolmap")
    directory, eo = flight
    insgnss.export(eo, form, tmp_path / "poses", **FORMATS[form])
    result = insgnss.calibrate_similarity(
        tmp_path / "poses",
        directory / "antenna.csv",
        pose_sigma=(0.003, 0.0001),
    )
    arm, sigma = (np.array(result.as_dict()[key]) for key in ("lever_arm_m", "sigma_m"))
    assert (np.abs(arm - ARM) < 4.0 * sigma).all()
    assert sigma[:2].max() < 3e-3
    json.dumps(result.as_dict()["components"])
    if form == "eo_json":
        assert result.mounting.date == "2018-07-01"  # the Sunday on which GPS week 2008 begins


def test_names_are_joined_without_their_endings(tmp_path) -> None:
    """Oracle: names by hand."""
    first, second, notes = join_by_name(
        ("a/DSC1.JPG", "a/DSC2.JPG"), ("DSC2", "DSC3"), tmp_path / "p", tmp_path / "q", 1
    )
    assert (first.tolist(), second.tolist()) == ([1], [0])
    assert notes == ("1 of 2 in p without partner: a/DSC1.JPG", "1 of 2 in q without partner: DSC3")


def test_markers_of_a_project_keep_their_standard_deviations_in_metres(tmp_path) -> None:
    """Oracle: the program states metres, in a CRS of feet as in any other."""
    ground = GroundTable(
        ("P",), np.array([[3.1e6, 1.7e6, 5e3]]), 1e-4 * np.eye(3)[None], np.array([False])
    )
    block = SimpleNamespace(ground=ground, crs="EPSG:6428")
    poses = CameraPoses(("a",), np.zeros((1, 3)), np.eye(3)[None], load=lambda: block)
    lat, lon, h = (float(x[0]) for x in GroundAxes(block.crs).geodetic(ground.position_m))
    path, plane = tmp_path / "project.psx", TangentPlane(lat, lon, h)
    placed = surveyed_points(path, path, poses, PlaceOptions(), plane)
    assert np.linalg.eigvalsh(placed.cov[0]) == pytest.approx(1e-4)


def test_what_holds_no_poses_is_refused(tmp_path) -> None:
    """Oracle: a table of fixes, and nothing."""
    (tmp_path / "fixes.csv").write_text("tow,lat,lon,h\n1,46,6,500\n2,46,6,500\n")
    with pytest.raises(InputError, match=r"fixes\.csv: no camera poses are known here; read are"):
        read_camera_poses(tmp_path / "fixes.csv")
    with pytest.raises(InputError, match="does not exist; check the path"):
        read_camera_poses(tmp_path / "none.csv")
