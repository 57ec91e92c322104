"""A simulated flight with the raw observations of its receivers: the files of the data set, and the
way from them to the exposures.
"""

import json
import sys
import tomllib
import types
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from insgnss.base.errors import UsageError
from insgnss.cli import main
from insgnss.geodesy.frames import geodetic_to_ecef
from insgnss.gnss.rinex.navigation_message import TOE, read_navigation
from insgnss.gnss.rinex.observations import read_observations
from insgnss.io.formats.orientation.eo_json import read_eo_json
from insgnss.simulation import dataset as writing
from insgnss.simulation.dataset import Dataset, write_dataset
from insgnss.simulation.raw_gnss.options import RawGnssOptions
from insgnss.simulation.raw_gnss.scenario import SIGNALS

SHORT = {"minutes": 2.0, "imu_rate": 100.0, "start_in_air": True, "seed": 3}
ROVER = "01_Observations/GPS/Data/Rover/rov01840.18"
MASTER = "01_Observations/GPS/Data/Master/tr2b0703a.18o"
RAW = {f"{ROVER}o", f"{ROVER}n", f"{ROVER}g", MASTER, "truth/raw_gnss.npz"}
BAND_2 = {"G": "W", "R": "P"}  # attribute of what RINEX 2 calls P2


@pytest.fixture(scope="module")
def data(tmp_path_factory) -> Dataset:
    return write_dataset(
        tmp_path_factory.mktemp("raw") / "ign8", **SHORT, raw_gnss=RawGnssOptions(rate_hz=5.0)
    )


def files(directory: Path) -> dict[str, Path]:
    return {
        path.relative_to(directory).as_posix(): path
        for path in directory.rglob("*")
        if path.is_file()
    }


def test_all_else_is_as_without_raw_observations(data, tmp_path):
    """Oracle: the same flight without them, file by file; flight file and readmes, which name them,
    apart.
    """
    plain = files(write_dataset(tmp_path / "plain", **SHORT).directory)
    found = files(data.directory)
    assert set(found) - set(plain) == RAW
    for name in set(plain) - {"flight.toml", "README.md", "FLIGHT.md"}:
        assert found[name].read_bytes() == plain[name].read_bytes(), name


def test_the_same_seed_writes_the_same_files(data, tmp_path):
    """Oracle: a second run; another seed writes others."""
    receivers = {"raw_gnss": RawGnssOptions(rate_hz=5.0)}
    again, other = (
        files(write_dataset(tmp_path / str(seed), **{**SHORT, "seed": seed}, **receivers).directory)
        for seed in (3, 4)
    )
    for name, path in files(data.directory).items():
        if name in RAW and path.suffix != ".npz":
            assert again[name].read_bytes() == path.read_bytes(), name
            assert other[name].read_bytes() != path.read_bytes(), name


@pytest.mark.parametrize("name", ["rover", "base"])
def test_observations_are_those_that_were_simulated(data, name):
    """Oracle: the arrays of the simulation, to half of a file's last digit; events in the rover's
    file alone.
    """
    raw = data.simulated.raw_gnss
    simulated = getattr(raw, name)
    found = read_observations(data.directory / (f"{ROVER}o" if name == "rover" else MASTER))
    assert_allclose(found.time, simulated.stamp, rtol=0.0, atol=0.5e-7)
    assert_array_equal(found.epoch, simulated.epoch)
    assert_array_equal(found.satellite, simulated.satellite)
    assert found.notes == ()
    for letter, attribute in BAND_2.items():
        rows = found.satellite.astype("U1") == letter
        assert rows.sum() > 4 * found.time.size
        for k, signal in enumerate(SIGNALS):
            code = (
                signal[0].replace("P", "C") + signal[1] + ("C" if signal[1] == "1" else attribute)
            )
            assert_allclose(
                found.of(code)[rows],
                simulated.values[rows, k],
                rtol=0.0,
                atol=0.501e-3,
                err_msg=code,
            )
            if signal[0] == "L":
                assert_array_equal(
                    found.loss_of_lock[rows, found.column(code)],
                    simulated.loss_of_lock[rows, int(signal[1]) - 1],
                )
    assert_allclose(found.events, raw.events if name == "rover" else [], rtol=0.0, atol=0.5e-7)


def test_events_are_those_of_the_camera_by_the_clock_of_the_rover(data):
    """Oracle: the events' file, in GPS time, and the true clock."""
    truth = np.load(data.directory / "truth/raw_gnss.npz")
    events = data.simulated.events.time
    clock = np.interp(events, truth["rover_time"], truth["rover_clock_s"])
    assert events.size > 10
    assert_allclose(
        read_observations(data.directory / f"{ROVER}o").events,
        events + clock,
        rtol=0.0,
        atol=1.5e-7,
    )
    assert_allclose(
        truth["rover_stamp"], truth["rover_time"] + truth["rover_clock_s"], rtol=0.0, atol=1e-9
    )


def test_messages_are_those_that_were_simulated(data):
    """Oracle: the table of the simulation, to the twelve decimals of a number in the file."""
    simulated = data.simulated.raw_gnss.navigation
    found = read_navigation([data.directory / f"{ROVER}n", data.directory / f"{ROVER}g"])
    assert found.left_out == ()
    mine, theirs = (np.lexsort((nav.table[:, TOE], nav.satellite)) for nav in (found, simulated))
    assert_array_equal(found.satellite[mine], simulated.satellite[theirs])
    assert_array_equal(found.channel[mine], simulated.channel[theirs])
    assert found.gps_week == simulated.gps_week
    assert_allclose(found.table[mine], simulated.table[theirs], rtol=5.1e-13, atol=1e-99)


def test_flight_file_names_the_raw_files_and_the_base(data):
    """Oracle: tomllib, the tree, and the base's true place, to 0.1 mm, and weather."""
    table = tomllib.loads(data.flight_file.read_text())["gnss"]
    assert {table["rover"], table["base"], *table["navigation"]} == RAW - {"truth/raw_gnss.npz"}
    assert "file" not in table
    lat, lon, height = table["base_position"]
    place = geodetic_to_ecef(np.radians(lat), np.radians(lon), height)
    assert_allclose(place, data.simulated.raw_gnss.base_position_m, rtol=0.0, atol=1e-4)
    assert_allclose(
        read_observations(data.directory / MASTER).header.approx_position_m,
        place,
        rtol=0.0,
        atol=2e-4,
    )
    assert table["base_point"] == "apc"
    assert table["atmosphere"] == vars(data.simulated.raw_gnss.weather)


def test_nothing_is_left_where_writing_fails(tmp_path, monkeypatch):
    """Oracle: the directory's listing."""

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(writing, "write_navigation", full)
    with pytest.raises(UsageError, match="No space left"):
        write_dataset(tmp_path / "x", **SHORT, raw_gnss=RawGnssOptions(rate_hz=1.0))
    assert list(tmp_path.iterdir()) == []


def test_the_verb_asks_for_raw_observations(tmp_path, monkeypatch):
    """Oracle: the options of `RawGnssOptions` by default, and none without the word."""
    seen = []
    module = types.ModuleType("insgnss.simulation.dataset")
    module.write_dataset = lambda directory, **options: seen.append(options)
    monkeypatch.setitem(sys.modules, "insgnss.simulation.dataset", module)
    assert main(["simulate", "-q", "d", "--raw-gnss"]) == 0
    assert main(["simulate", "-q", "d"]) == 0
    assert seen[0]["raw_gnss"] == RawGnssOptions()
    assert "raw_gnss" not in seen[1]


@pytest.mark.slow
def test_from_raw_observations_to_the_exposures(data, tmp_path, capsys):
    """Oracle: the truth of the simulation. Every fix fixed; two minutes hold one or two independent
    errors of the atmosphere and of reflections (3 mm and 10 mm claimed), so exposures lie within
    four standard deviations of truth, and within 3 cm in any case."""
    if find_spec("pyrtklib5") is None:
        pytest.skip("pyrtklib5 is not installed")
    assert main(["process", "-q", str(data.flight_file), "--out", str(tmp_path / "out")]) == 0
    capsys.readouterr()
    eo, truth = read_eo_json(tmp_path / "out/eo.json"), np.load(data.directory / "truth/eo.npz")
    assert eo.images == tuple(truth["images"].tolist())
    error = eo.position_m - truth["position_enu"]
    sigma = np.sqrt(np.diagonal(eo.cov, axis1=1, axis2=2))
    assert np.abs(error).max() < 0.03
    assert np.abs(error / sigma[:, :3]).max() < 4.0
    turned = (Rotation.from_matrix(eo.C_mc) * Rotation.from_matrix(truth["C_mc"]).inv()).as_rotvec()
    assert np.abs(turned / sigma[:, 3:]).max() < 4.0
    ppk = json.loads((tmp_path / "out/report.json").read_text())["ppk"]
    assert ppk["quality"]["fix_rate"] == 1.0
    assert ppk["quality"]["epochs"] >= 599
