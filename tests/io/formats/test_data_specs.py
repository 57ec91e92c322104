"""Every example of data_specs goes through the reader of its name."""

import re
import tomllib
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from format_pages import SPECS, on_page
from oracles import oracle

from insgnss.base.errors import InputError
from insgnss.batch.season.tables import read_season
from insgnss.flight.inspection.discovery import sources_of
from insgnss.flight.sensors.kinds import read_measurement
from insgnss.flight.sensors.options import MeasurementInput
from insgnss.gnss.rinex.navigation_message import read_navigation
from insgnss.gnss.rinex.observations import read_observations
from insgnss.io import formats
from insgnss.io.formats import EXPORTS, read_imu
from insgnss.io.formats.blocks.bingo import read_bingo
from insgnss.io.formats.blocks.camera_toml import read_camera_toml
from insgnss.io.formats.blocks.dbat import read_dbat
from insgnss.io.formats.blocks.gcp_list import read_gcp_list
from insgnss.io.formats.blocks.ground_points import read_ground_points
from insgnss.io.formats.blocks.image_points import read_image_points
from insgnss.io.formats.blocks.pose_table import read_pose_table
from insgnss.io.formats.blocks.reading import read_measured_block
from insgnss.io.formats.imu.variances import read_variances
from insgnss.io.formats.orientation.eo_json import read_eo_json
from insgnss.io.formats.orientation.eo_local_plane import read_eo_local_plane
from insgnss.io.formats.orientation.mounting_file import read_mounting_file
from insgnss.io.formats.orientation.relative_csv import read_relative_csv
from insgnss.io.formats.positions.camera_positions import read_camera_positions
from insgnss.io.formats.returned.tables import read_metashape_reference
from insgnss.io.formats.trajectory.odyn import read_odyn_poses
from insgnss.io.formats.trajectory.sbet import read_sbet
from insgnss.io.formats.trajectory.trajectory_csv import read_trajectory_csv
from insgnss.io.formats.vehicle.target_positions import read_target_positions
from insgnss.io.formats.vehicle.target_sizes import read_target_sizes

NOT_IN_THE_FILE = {"sigma_m": (2.0, 2.0, 4.0)}  # what a format's file may lack


def of_recordings() -> dict[str, Callable[[Path], Any]]:
    """The reader of each registered format whose page has a bad line."""
    found: dict[str, Callable[[Path], Any]] = {}
    for kind, readers in formats.READERS.items():
        read = getattr(formats, f"read_{kind}")
        for form, reader in readers.items():
            path = SPECS / f"{form}.md"
            if form != "sbet" and "```bad" in path.read_text():
                needed = {k: v for k, v in NOT_IN_THE_FILE.items() if k in reader.lacks.split()}
                found.setdefault(form, partial(read, **needed))
    return found


READERS: dict[str, Callable[[Path], Any]] = of_recordings() | {
    "camera_positions": read_camera_positions,
    "measurement": lambda path: read_measurement(MeasurementInput(kind="heading", file=path), 2000),
    "odyn": read_odyn_poses,
    "eo_local_plane": read_eo_local_plane,
    "metashape": read_metashape_reference,
    "trajectory_csv": read_trajectory_csv,
    "variances": read_variances,
    "relative_csv": read_relative_csv,
    "rinex": read_observations,
    "image_points": read_image_points,
    "ground_points": read_ground_points,
    "target_positions": read_target_positions,
    "target_sizes": read_target_sizes,
    "camera_toml": read_camera_toml,
    "gcp_list": read_gcp_list,
    "season": read_season,
    "pose_table": read_pose_table,
    "bingo": lambda path: read_bingo(path, pixel_um=1.55, width=5456, height=3632),
}


@pytest.mark.parametrize("name", READERS)
def test_true_lines_are_read_and_the_bad_one_is_refused_as_printed(
    name: str, tmp_path: Path
) -> None:
    """Oracle: the page of the format."""
    path = tmp_path / name
    path.write_text(on_page(name, "true"))
    READERS[name](path)
    path.write_text(on_page(name, "true") + on_page(name, "bad"))
    with pytest.raises(InputError) as refusal:
        READERS[name](path)
    assert on_page(name, "message").strip() in str(refusal.value)


@pytest.mark.parametrize(
    ("kind", "form"),
    [
        (kind, form)
        for kind, readers in formats.READERS.items()
        for form, reader in readers.items()
        if reader.tells and kind != "barometer"
    ],
)
def test_inspect_finds_what_a_format_that_tells_itself_holds(
    kind: str, form: str, tmp_path: Path
) -> None:
    """Oracle: the registry, and the page's example."""
    path = tmp_path / ("x_events.pos" if form == "events_pos" else form)
    path.write_text(on_page(form))
    (source,) = sources_of(path)
    assert source.role == kind
    assert formats.READERS[kind][form].what in source.what


def test_sbet_page(tmp_path: Path) -> None:
    """Oracle: the numbers that the page gives in words."""
    path = tmp_path / "x.sbet"
    path.write_bytes(bytes.fromhex(on_page("sbet", "true")))
    got = read_sbet(path)
    assert got.time[0] == 200000.0
    assert got.height[0] == 630.0
    assert got.velocity_ned[0].tolist() == [10.0, 0.0, 0.0]
    assert got.lat[0] * 57.29577951308232 == pytest.approx(46.57, abs=1e-12)
    path.write_bytes(bytes.fromhex(on_page("sbet", "true") + on_page("sbet", "bad")))
    with pytest.raises(InputError, match=on_page("sbet", "message").strip()):
        read_sbet(path)


def test_rinex_page(tmp_path: Path) -> None:
    """Oracle: the values, stamps, flags and events that can be read off the page by eye."""
    (tmp_path / "x.18o").write_text(on_page("rinex", "true"))
    got = read_observations(tmp_path / "x.18o")
    assert got.time.tolist() == [392700.0, 392700.1]
    assert got.events.tolist() == pytest.approx([392700.0421877, 392700.0921877], abs=1e-8)
    assert got.satellite.tolist() == ["G05", "R11", "G05"]
    assert got.of("L2W")[0] == 82401917.123
    assert got.loss_of_lock[0, got.column("L2W")] == 1
    assert np.isnan(got.of("C2P")[1])
    (tmp_path / "x.18n").write_text(on_page("rinex", "nav"))
    assert read_navigation(tmp_path / "x.18n").satellite.tolist() == ["G05"]


def test_dbat_page(tmp_path: Path) -> None:
    """Oracle: the numbers of the page's script and tables, by eye: 156 pixels in a millimetre, the
    y of P2 turned down, the longest coordinate between the two images held.
    """
    for kind, name in (("script", "block.xml"), ("images", "images.txt"), ("eo", "eo.txt")):
        (tmp_path / name).write_text(on_page("dbat", kind))
    (tmp_path / "points.txt").write_text(on_page("dbat", "true"))
    got = read_dbat(tmp_path / "block.xml")
    (camera,) = got.cameras
    assert camera.interior.tolist() == pytest.approx(
        [24.3581 * 156, 18.1143 * 156, 12 * 156, 0, 0, 2.174e-4, -1.518e-7, 0, 0, 1e-5, -2e-5]
    )
    assert camera.backward
    assert camera.unit_px == 156.0
    assert camera.free == ("f", "cx", "cy", "k1", "k2")
    assert got.images == ("IMG_0087.JPG", "IMG_0088.JPG")
    assert got.held.tolist() == [[True] * 6, [False, True, False, False, False, False]]
    assert got.observations.uv[1].tolist() == [2568.26, 1866.7021]
    assert got.observations.sigma_px.tolist() == [[0.5, 0.5]] * 2
    (tmp_path / "points.txt").write_text(on_page("dbat", "true") + on_page("dbat", "bad"))
    with pytest.raises(InputError) as refusal:
        read_dbat(tmp_path / "block.xml")
    assert on_page("dbat", "message").strip() in str(refusal.value)


def test_metashape_block_page(tmp_path: Path) -> None:
    """Oracle: the numbers of the page's file, by eye, and an image that is not there."""
    true = on_page("metashape_block", "true")
    path = tmp_path / "cameras.xml"
    path.write_text(true)
    got = read_measured_block(path)
    (camera,) = got.cameras
    assert camera.of("cx") == pytest.approx(5472 / 2 - 32.412)
    assert (camera.of("p1"), camera.of("b2")) == (-0.00209, 0.709)
    assert got.measured.observations.uv.tolist() == [[4233.8418, 27.5736141]]
    assert got.measured.observations.sigma_px.tolist() == [[0.5, 0.5]]
    assert (got.ground.points, got.crs) == (("C07",), "EPSG:3826")
    last = next(line for line in true.splitlines(keepends=True) if "<location" in line)
    path.write_text(true.replace(last, on_page("metashape_block", "bad")))
    with pytest.raises(InputError, match=re.escape(on_page("metashape_block", "message").strip())):
        read_measured_block(path)


def test_colmap_model_page(tmp_path: Path) -> None:
    """Oracle: the page's camera lines, in a model without images."""
    oracle("pycolmap")
    for name in ("images", "points3D"):
        (tmp_path / f"{name}.txt").write_text("")
    (tmp_path / "cameras.txt").write_text(on_page("colmap_model", "true"))
    (camera,) = read_measured_block(tmp_path).cameras
    assert (camera.of("p1"), camera.of("p2")) == (-0.0006, 0.0009)
    (tmp_path / "cameras.txt").write_text(on_page("colmap_model", "bad"))
    with pytest.raises(InputError, match=re.escape(on_page("colmap_model", "message").strip())):
        read_measured_block(tmp_path)


def test_opensfm_model_page(tmp_path: Path) -> None:
    """Oracle: the page's formula for pixels on its line, 1280 x 960 pixels."""
    camera = '{"width": 1280, "height": 960, "focal": 0.9, "projection_type": "perspective"}'
    shot = '{"camera": "c", "rotation": [0, 0, 0], "translation": [0, 0, 0]}'
    (tmp_path / "reconstruction.json").write_text(
        f'[{{"cameras": {{"c": {camera}}}, "shots": {{"8001.tif": {shot}}}}}]'
    )
    (tmp_path / "tracks.csv").write_text(on_page("opensfm_model", "true"))
    got = read_measured_block(tmp_path).measured.observations
    assert got.uv.tolist() == [[0.5 * 1280 - 0.125 * 1280, 0.5 * 960 + 0.0625 * 1280]]
    text = on_page("opensfm_model", "true") + on_page("opensfm_model", "bad")
    (tmp_path / "tracks.csv").write_text(text)
    with pytest.raises(InputError, match=re.escape(on_page("opensfm_model", "message").strip())):
        read_measured_block(tmp_path)


def test_eo_json_page(tmp_path: Path) -> None:
    """Oracle: the page of the format."""
    path = tmp_path / "eo.json"
    path.write_text(on_page("eo_json", "bad"))
    with pytest.raises(InputError, match=on_page("eo_json", "message").strip()):
        read_eo_json(path)


def test_matlab_page(tmp_path: Path) -> None:
    """Oracle: the page's call on a struct of the fields in its message."""
    from scipy.io import savemat

    savemat(
        tmp_path / "flight.mat",
        {"flight_data": {"time": [0.0, 1.0], "p": [0.0, 0.0], "q": [0.0, 0.0]}},
    )
    with pytest.raises(InputError, match=on_page("matlab", "message").strip()):
        read_imu(tmp_path / "flight.mat", variable="flight_data", columns={"tow": "zeit"})


def test_npy_page(tmp_path: Path) -> None:
    """Oracle: the page's words, with numpy.save."""
    np.save(tmp_path / "x.npy", np.ones((4, 6)))
    whole = (tmp_path / "x.npy").read_bytes()
    spec = {"columns": ["gx", "gy", "gz", "ax", "ay", "az"], "rate_hz": 100.0}
    assert read_imu(tmp_path / "x.npy", **spec).time.tolist() == [0.0, 0.01, 0.02, 0.03]
    (tmp_path / "x.npy").write_bytes(whole[:-5])
    with pytest.raises(InputError, match=re.escape(on_page("npy", "message").strip())):
        read_imu(tmp_path / "x.npy", **spec)


def test_ulog_page(tmp_path: Path) -> None:
    """Oracle: the ULog header (magic, version, start) as its documentation states it, and nothing
    behind it.
    """
    oracle("pyulog")
    (tmp_path / "x.ulg").write_bytes(b"ULog\x01\x12\x35\x01" + bytes(8))
    with pytest.raises(InputError, match=on_page("ulog", "message").strip()):
        read_imu(tmp_path / "x.ulg")


def test_mounting_file_page(tmp_path: Path) -> None:
    """Oracle: the numbers of the page, by eye."""
    path = tmp_path / "mounting.toml"
    path.write_text(on_page("mounting_file", "true"))
    got, _ = read_mounting_file(path)
    assert got.antenna_m is not None
    assert got.antenna_m.tolist() == [0.4621, -0.0013, -0.0654]
    assert (got.imu_m, got.date, got.camera) == (None, "2018-07-06", "ILCE-7R")
    sigma = got.sigma("antenna_m")
    assert sigma is not None
    assert sigma.tolist() == pytest.approx([0.0004, 0.0004, 0.0003])
    path.write_text(on_page("mounting_file", "bad"))
    with pytest.raises(InputError, match=re.escape(on_page("mounting_file", "message").strip())):
        read_mounting_file(path)


@pytest.mark.parametrize("name", ["noise_model", "flight_file", "block_file", "imu_calibration"])
def test_pages_of_settings_are_toml(name: str) -> None:
    """Oracle: tomllib."""
    assert tomllib.loads(on_page(name, "true"))
    assert tomllib.loads(on_page(name, "bad"))


def test_every_page_is_tested() -> None:
    """Oracle: the directory's listing; the pages of formats that are only written have their
    examples in the tests of the exports.
    """
    written = {form.page for form in EXPORTS.values()}
    tested = {
        *READERS,
        "camera_files",  # in test_camera_files
        "colmap_model",
        "dbat",
        "metashape_block",
        "opensfm_model",
        "sbet",
        "eo_json",
        "eo_covariance",
        "matlab",
        "npy",
        "ulog",
        "imu_calibration",
        "mounting_file",
        "pose_covariance",
        "returned",  # in test_returned_poses
        "noise_model",
        "noise_exports",  # in test_noise_exports
        "rosbag",  # in test_rosbag
        "adjust_json",  # in test_adjust
        "targets",  # with the two below in target_measurement/test_targets
        "metashape_markers",
        "pix4d_marks",
        "block_file",
        "flight_file",
        "README",
    }
    assert {path.stem for path in SPECS.glob("*.md")} == tested | written
