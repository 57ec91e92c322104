"""Where the products go: which files are the inputs, and where the solution of raw observations is
kept, whole or not at all.
"""

import hashlib
import json
import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from written import image_positions

from insgnss import load_flight
from insgnss.base.errors import DataError, InputError, UsageError
from insgnss.base.provenance import INPUTS_KEY, hashes_of
from insgnss.flight.inspection.discovery import sources_of
from insgnss.flight.processing import pipeline, products
from insgnss.flight.processing.input_files import input_files, measurements
from insgnss.flight.processing.pipeline import process
from insgnss.flight.processing.products import PPK_PRODUCTS, ppk_directory
from insgnss.geodesy.frames import TangentPlane
from insgnss.gnss import from_flight_file as flown
from insgnss.gnss.ppk import PpkResult
from insgnss.io.exposures.rig import ClockOffsets
from insgnss.io.formats import read_gnss
from insgnss.io.formats.orientation.eo_covariance import read_eo_covariance
from insgnss.io.formats.orientation.eo_json import read_eo_json
from insgnss.records import CameraEvents
from insgnss.simulation.dataset import write_dataset

OF_THE_ENGINE = (
    "engine",
    "ppk",
    "velocity",
    "ionosphere",
    "troposphere",
    "quality",
    "signals",
)  # modules of gnss
READY = "02_Processed/GPS-PPK/AntennaPos_WGS84.txt"
EVENTS = "01_Observations/Camera/Data/Events.txt"


@pytest.fixture(scope="module")
def simulated(tmp_path_factory):
    """A flight of which the RINEX files are mere names: the engine's answer is `answer`."""
    root = tmp_path_factory.mktemp("products") / "ign8"
    write_dataset(root, "ign8", 2.5, imu_rate=100.0, seed=11, start_in_air=True)
    for name in ("r.obs", "b.obs", "n.nav", "igs.atx"):
        (root / name).write_text("RINEX\n")
    shutil.move(root / READY, root / "truth" / "fixes.txt")
    shutil.rmtree(root / "02_Processed")
    text = (root / "flight.toml").read_text()
    raw = (
        'rover = "r.obs"\nbase = "b.obs"\nnavigation = ["n.nav"]\nantex = "igs.atx"\nbase_position'
        ' = [46.5, 6.5, 500.0]\nbase_point = "arp"'
    )
    (root / "flight.toml").write_text(text.replace(f'file = "{READY}"', raw))
    return root


@pytest.fixture
def flight(simulated, tmp_path, monkeypatch):
    """A copy of the flight with an engine that answers with the simulated fixes and, of the rover's
    file, the exposures.
    """
    shutil.copytree(simulated, tmp_path / "ign8")

    def solve(given):
        fixes = replace(
            read_gnss(tmp_path / "ign8" / "truth" / "fixes.txt", gps_week=2008), source="r.obs"
        )
        quality = {"fix_rate": 1.0, "classes": {"fixed": len(fixes)}}
        return PpkResult(fixes, None, (), "good", quality, {}, {}, "fake", 0.0)

    monkeypatch.setattr(flown, "solve_ppk", solve)
    monkeypatch.setattr(
        "insgnss.report.page.write_report", lambda path, *_: path.write_text("report")
    )
    return load_flight(tmp_path / "ign8")


def test_every_file_that_the_result_depends_on_is_an_input(flight):
    """Oracle: the flight file, which names rover, base, navigation, phase centres, a list of
    images, samples and events.
    """
    root = flight.path.parent
    (root / "images.txt").write_text("a.tif\n")
    (root / "geoid.gtx").write_bytes(b"grid")
    match = replace(flight.camera.match, images=root / "images.txt")
    output = replace(flight.output, geoid=root / "geoid.gtx")
    given = replace(flight, camera=replace(flight.camera, match=match), output=output)
    names = {os.path.relpath(file, root) for file in input_files(given)}
    assert names == {
        *("flight.toml", "r.obs", "b.obs", "n.nav", "igs.atx", "images.txt", "geoid.gtx", EVENTS),
        "01_Observations/IMU/Data/Pre_calibrated/f8_1_sob.csv",
    }
    directory = replace(flight.camera, match=replace(match, images=root))
    assert root not in input_files(replace(flight, camera=directory))


@pytest.mark.parametrize("name", [EVENTS, "flight.toml"])
def test_no_file_is_hashed_that_is_not_the_one_that_was_read(flight, monkeypatch, name):
    """Oracle: a file that another one replaces after it was read; nothing is written."""
    path, real = flight.path.parent / name, pipeline.read_recording

    def read_recording(given):
        recording = real(given)
        path.with_name("other").write_bytes(path.read_bytes() + b"# edited\n")
        os.replace(path.with_name("other"), path)
        return recording

    monkeypatch.setattr(pipeline, "read_recording", read_recording)
    monkeypatch.setattr("insgnss.base.beside.processors", lambda: 1)  # hashed at the end
    with pytest.raises(InputError, match=rf"{path.name}: the file changed after it was read; wait"):
        process(flight)
    assert not (flight.path.parent / "02_Processed").exists()


def test_a_flight_that_memory_does_not_hold_is_refused_before_it_is_filtered(flight, monkeypatch):
    """Oracle: the steps that were begun, and the sizes of the flight: 150 s at 100 Hz."""
    monkeypatch.setattr("insgnss.flight.processing.estimation_problem.available", lambda: 1_000_000)
    steps = []
    with pytest.raises(DataError, match=r"^some 0\.\d GB .* of 1\d{4} samples 0\.0, filter"):
        process(flight, progress=steps.append)
    assert steps == ["read", "prepare"]


def test_the_solution_stands_where_the_published_tree_has_it(flight):
    """Oracle: Figure 9 of paper 000, the readers of the files, the tangent plane of eo.json, and
    hashlib.
    """
    result = process(flight)
    root = flight.path.parent
    place = root / "02_Processed" / "GPS-PPK"
    assert {path.name for path in place.iterdir()} == set(PPK_PRODUCTS)
    assert {path for path in result.files if path.parent == place} == {
        place / name for name in PPK_PRODUCTS
    }
    assert all(path.is_file() for path in result.files)
    assert {path.name for path in (root / "02_Processed").iterdir()} == {"GPS-INS", "GPS-PPK"}
    truth = read_gnss(root / "truth" / "fixes.txt", gps_week=2008)
    for name in ("ppk.pos", "AntennaPos_WGS84.txt"):
        fixes = read_gnss(place / name, gps_week=2008)
        assert np.allclose(fixes.time, truth.time, rtol=0, atol=1e-6)
        assert np.allclose(fixes.height, truth.height, rtol=0, atol=1e-4)
    (images, geodetic), (plane_images, plane) = (
        image_positions(place / f"AntennaPos_Img_WGS84{end}.txt") for end in ("", "_tangentplane")
    )
    assert images == plane_images == result.eo.images
    expected = TangentPlane(*result.eo.origin).position_from_geodetic(*geodetic.T)
    assert np.abs(expected - plane).max() < 2e-4
    assert (
        np.abs(
            np.linalg.norm(plane - result.eo.position_m, axis=1)
            - np.linalg.norm(flight.mounting.antenna_m)
        ).max()
        < 0.2
    )
    report = json.loads((flight.output.directory / "report.json").read_text())
    assert report["ppk"]["directory"] == "../GPS-PPK"
    assert report["ppk"]["notes"] == []
    assert (
        report["inputs_sha256"]["igs.atx"]
        == hashlib.sha256((root / "igs.atx").read_bytes()).hexdigest()
    )


@pytest.mark.slow
def test_the_covariance_of_strips_stands_beside_the_images(flight, tmp_path):
    """Oracle: the result in memory, bit by bit; a file of an earlier run is not taken for one of
    this run, and where none is asked for there is none.
    """
    result = process(flight)
    place = flight.output.directory
    eo = read_eo_json(place / "eo.json")
    found = read_eo_covariance(place / "eo_covariance.npz", eo)
    assert place / "eo_covariance.npz" in result.files
    assert sources_of(place / "eo_covariance.npz") == []  # of no recording
    assert found
    for strip, written in zip(result.strips, found, strict=True):
        np.testing.assert_array_equal(written.rows, strip.rows)
        np.testing.assert_array_equal(written.cov, strip.cov)
    other = replace(flight.gnss, gate_sigma=4.9, time_sigma_s=1e-3)
    output = replace(flight.output, strip_covariance=False, formats=())
    without = process(replace(flight, gnss=other, output=output), tmp_path / "other")
    assert not (tmp_path / "other" / "eo_covariance.npz").exists()
    assert without.strips == ()
    with pytest.raises(InputError, match=r"does not belong to this eo\.json: the covariance of"):
        read_eo_covariance(
            place / "eo_covariance.npz", read_eo_json(tmp_path / "other" / "eo.json")
        )


def test_it_stands_within_a_directory_of_another_name(flight, tmp_path):
    """Oracle: the rule; nothing is written outside of the directory that was asked for."""
    result = process(flight, tmp_path / "out")
    assert {path.name for path in (tmp_path / "out" / "GPS-PPK").iterdir()} == set(PPK_PRODUCTS)
    assert all(path.is_relative_to(tmp_path / "out") for path in result.files)
    assert not (tmp_path / "GPS-PPK").exists()


def test_positions_of_others_are_left_alone(tmp_path, monkeypatch):
    """Oracle: the rule: positions without a ppk.pos beside them are not of insgnss, and those with
    one are replaced.
    """
    out, beside = tmp_path / "GPS-INS", tmp_path / "GPS-PPK"
    assert ppk_directory(out) == beside
    beside.mkdir()
    (beside / "base.txt").write_text("mine")
    assert ppk_directory(out) == beside
    (beside / "AntennaPos_Img_WGS84.txt").write_text("published")
    assert ppk_directory(out) == out / "GPS-PPK"
    (beside / "ppk.pos").write_text("ours")
    assert ppk_directory(out) == beside
    out.mkdir()
    monkeypatch.chdir(out)
    assert ppk_directory(Path(".")) == beside


def test_the_published_positions_of_a_flight_stay_as_they_are(flight):
    """Oracle: the bytes; the flight's own go into the output directory."""
    root = flight.path.parent
    (root / READY).parent.mkdir(parents=True)
    (root / READY).write_text("published")
    result = process(flight)
    assert (root / READY).read_text() == "published"
    assert flight.output.directory / "GPS-PPK" / "ppk.pos" in result.files


def test_nothing_is_left_where_a_product_cannot_be_written(flight, monkeypatch):
    """Oracle: the tree of files before, with a fault in the last step before the files move."""
    root = flight.path.parent
    before = sorted(root.rglob("*"))

    def fail(*_):
        raise InputError("no room")

    monkeypatch.setattr("insgnss.flight.processing.products.write_report_json", fail)
    with pytest.raises(InputError, match="no room"):
        process(flight)
    assert sorted(root.rglob("*")) == before


@pytest.mark.parametrize("what", ["directory", "file", "input"])
def test_what_is_in_the_way_of_the_solution_is_refused_before_the_work(flight, what):
    """Oracle: the contract: bad input where the flight file names the directory; inputs stay."""
    place = flight.output.directory.parent / "GPS-PPK"
    place.parent.mkdir()
    given = flight
    if what == "file":
        place.write_text("mine")
    else:
        place.mkdir()
        (place / "ppk.pos").write_text("ours")
    if what == "directory":
        (place / "AntennaPos_WGS84.txt").mkdir()
    if what == "input":
        (place / "AntennaPos_WGS84.txt").write_text("1.0\n")
        given = replace(
            flight, camera=replace(flight.camera, events=place / "AntennaPos_WGS84.txt")
        )
    words = {
        "directory": "is a directory and in the way",
        "file": "is a file, a directory is expected",
        "input": "overwrite the input",
    }
    with pytest.raises(InputError, match=rf"output\.directory: .*{words[what]}"):
        products.output_directory(given, None)


def test_exposures_without_fixes_around_them_are_told_and_the_rest_is_written(flight, tmp_path):
    """Oracle: the times: none, one and all of three exposures behind the last fix."""
    fixes = read_gnss(flight.path.parent / "truth" / "fixes.txt", gps_week=2008)
    solved = PpkResult(fixes, None, (), "good", {}, {}, {}, "fake", 0.0)
    shots = fixes.time[0] + np.array([20.03, 40.05, 60.07])
    for late, told, files in (
        (0, "", 4),
        (1, "1 of 3 images have no fixes around them: c", 4),
        (3, "none of the 3 exposures", 2),
    ):
        time = shots + 1e4 * (np.arange(3) >= 3 - late)
        out = tmp_path / str(late)
        out.mkdir()
        events = CameraEvents(("a", "b", "c"), time, 2008)
        recorded = SimpleNamespace(events=events, offsets=ClockOffsets())
        notes = products._write_solution(recorded, solved, None, out)
        assert (told in notes[0]) if told else notes == []
        assert {path.name for path in out.iterdir()} == set(PPK_PRODUCTS[:files])


def test_positions_at_exposures_are_on_the_clock_of_the_fixes(flight, tmp_path):
    """Oracle: an exposure at the instant of a fix, whose stamps the flight file moves by half a
    second.
    """
    fixes = read_gnss(flight.path.parent / "truth" / "fixes.txt", gps_week=2008)
    solved = PpkResult(fixes, None, (), "good", {}, {}, {}, "fake", 0.0)
    events = CameraEvents(("a",), fixes.time[[100]] + 0.5, 2008)
    recorded = SimpleNamespace(events=events, offsets=ClockOffsets(0.0, 0.5, 0.0))
    assert products._write_solution(recorded, solved, None, tmp_path) == []
    (place,) = image_positions(tmp_path / "AntennaPos_Img_WGS84.txt")[1]
    assert np.allclose(
        place,
        [fixes.lat[100], fixes.lon[100], fixes.height[100]],
        rtol=0.0,
        atol=[1e-11, 1e-11, 1e-4],
    )


def test_a_run_without_raw_observations_does_not_load_what_solves_them():
    """Oracle: sys.modules of a fresh interpreter."""
    code = (
        f"import sys, insgnss.flight.processing.pipeline; print([m for m in {OF_THE_ENGINE} if"
        " 'insgnss.gnss.' + m in sys.modules])"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout.split() == ["[]"]


@pytest.mark.parametrize("of", ["rover", "base"])
def test_each_file_of_a_receiver_is_a_measurement(tmp_path, of):
    """Oracle: the second file of rover or base changes after the results were made."""
    names = {"rover": ["r1.18o", "r2.18o"], "base": ["b1.18o", "b2.18o"], "navigation": ["n.18n"]}
    for name in ("imu.csv", *(name for files in names.values() for name in files)):
        (tmp_path / name).write_text(name)
    gnss = "\n".join(f"{key} = {json.dumps(files)}" for key, files in names.items())
    text = f'[imu]\nfile = "imu.csv"\n[gnss]\n{gnss}\n[output]\ndirectory = "out"\n'
    (tmp_path / "flight.toml").write_text(f'name = "f"\n{text}')
    flight = load_flight(tmp_path / "flight.toml")
    (tmp_path / "out").mkdir()
    made_from = hashes_of(measurements(flight), tmp_path)
    (tmp_path / "out" / "report.json").write_text(json.dumps({INPUTS_KEY: made_from}))
    out = products.output_directory(flight, None)
    assert out == tmp_path / "out"
    assert products.overwriting(flight, out, None) is None
    (tmp_path / names[of][1]).write_text("of another flight")
    for named, kind in ((None, InputError), (out, UsageError)):
        error = products.overwriting(flight, out, named)
        assert type(error) is kind
        assert f"report.json was not made from {names[of][1]}" in str(error)
