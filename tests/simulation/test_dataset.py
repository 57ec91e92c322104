"""A simulated flight as a data set on disk."""

import tomllib

import numpy as np
import pyproj
import pytest
from numpy.testing import assert_allclose

from insgnss import load_flight
from insgnss.base.errors import InputError, UsageError
from insgnss.io.formats.events.events import read_events
from insgnss.io.formats.gnss.gnss_text import read_gnss_text
from insgnss.io.formats.imu.imu_csv import read_imu_csv
from insgnss.io.formats.read_options import ReadOptions
from insgnss.navigation.noise_model.model import load_noise_model
from insgnss.simulation.dataset import Dataset, write_dataset

TREE = {
    "flight.toml",
    "README.md",
    "FLIGHT.md",
    "01_Observations/Camera/Data/Events.txt",
    "01_Observations/Camera/GCPs/WGS84.txt",
    "01_Observations/Camera/GCPs/WGS84_tangentplane.txt",
    "01_Observations/IMU/Data/Pre_calibrated/f8_1_sob.csv",
    "02_Processed/GPS-PPK/AntennaPos_WGS84.txt",
    "02_Processed/GPS-PPK/AntennaPos_Img_WGS84.txt",
    "02_Processed/GPS-PPK/AntennaPos_Img_WGS84_tangentplane.txt",
    "truth/EO_local-plane.txt",
    "truth/eo.npz",
    "truth/trajectory.npz",
}
SHORT = {"minutes": 1.5, "imu_rate": 50.0, "start_in_air": True, "seed": 3}


@pytest.fixture(scope="module")
def dataset(tmp_path_factory) -> Dataset:
    axes = {"imu_axes": "right backward down", "gyro_unit": "deg/s", "accel_unit": "g"}
    return write_dataset(tmp_path_factory.mktemp("data") / "ign8", **SHORT, **axes)


def numbers(path, **options):
    return np.loadtxt(path, comments="#", **options)


def named(path):
    """Names of the first column, numbers of the others."""
    rows = [line.split() for line in path.read_text().splitlines() if not line.startswith("#")]
    return tuple(row[0] for row in rows), np.array([row[1:] for row in rows], dtype=float).squeeze()


def test_the_tree_is_complete_and_nothing_else_is_left(dataset):
    """Oracle: Figure 9 of paper 000, as far as it can be simulated, and design.md 4."""
    assert {
        p.relative_to(dataset.directory).as_posix()
        for p in dataset.directory.rglob("*")
        if p.is_file()
    } == TREE
    assert [p.name for p in dataset.directory.parent.iterdir()] == ["ign8"]


def test_flight_file_names_files_that_are_there(dataset):
    """Oracle: tomllib and the keys of design.md 4."""
    flight = tomllib.loads(dataset.flight_file.read_text())
    for file in (flight["imu"]["file"], flight["gnss"]["file"], flight["camera"]["events"]):
        assert (dataset.directory / file).is_file()
    assert (flight["name"], flight["gps_week"]) == ("ign8", 2008)
    assert flight["imu"]["units"] == {"gyro": "deg/s", "accel": "g"}
    assert flight["imu"]["axes"] == "right backward down"
    assert flight["imu"]["noise"] == "navchip"
    assert flight["mounting"]["antenna_m"] == [0.462, -0.001, -0.065]
    assert_allclose(
        np.array(flight["mounting"]["boresight"]) @ np.array(flight["mounting"]["boresight"]).T,
        np.eye(3),
        rtol=0,
        atol=1e-14,
    )
    assert flight["tangent_plane"]["origin"] == [46.57, 6.54, 0.0]


def test_imu_file_holds_the_samples_in_its_units(dataset):
    """Oracle: numpy.loadtxt and the definitions of degree and standard gravity; rounding is half
    the last digit.
    """
    path = dataset.directory / "01_Observations/IMU/Data/Pre_calibrated/f8_1_sob.csv"
    table = numbers(path, delimiter=",", skiprows=1)
    imu = dataset.simulated.imu
    assert (
        path.read_text().splitlines()[0] == "tow[s],gx[deg/s],gy[deg/s],gz[deg/s],ax[g],ay[g],az[g]"
    )
    assert_allclose(table[:, 0], imu.time, rtol=0, atol=1e-7)
    assert_allclose(np.radians(table[:, 1:4]), imu.gyro, rtol=0, atol=1e-9)
    assert_allclose(table[:, 4:] * 9.80665, imu.accel, rtol=0, atol=1e-8)
    assert np.median(table[:, 6]) == pytest.approx(-1.0, abs=0.1)  # z down feels minus one g


def test_positions_of_the_two_frames_agree(dataset):
    """Oracle: pyproj's topocentric pipeline; printed digits are 0.01 mm and 0.1 mm."""
    topocentric = pyproj.Transformer.from_pipeline(
        "+proj=pipeline +step +proj=cart +ellps=WGS84 +step +proj=topocentric +ellps=WGS84"
        " +lat_0=46.57 +lon_0=6.54 +h_0=0"
    )
    root = dataset.directory
    for geodetic, plane in (
        (
            "02_Processed/GPS-PPK/AntennaPos_Img_WGS84.txt",
            "02_Processed/GPS-PPK/AntennaPos_Img_WGS84_tangentplane.txt",
        ),
        (
            "01_Observations/Camera/GCPs/WGS84.txt",
            "01_Observations/Camera/GCPs/WGS84_tangentplane.txt",
        ),
    ):
        (first, llh), (second, enu) = named(root / geodetic), named(root / plane)
        assert first == second
        assert_allclose(
            np.stack(topocentric.transform(llh[:, 1], llh[:, 0], llh[:, 2]), axis=-1),
            enu,
            atol=2e-4,
        )


def test_targets_lie_on_the_ground_under_the_flight(dataset):
    """Oracle: ground at 510 m; 40 targets of some relief, inside the images' area."""
    _, enu = named(dataset.directory / "01_Observations/Camera/GCPs/WGS84_tangentplane.txt")
    assert len(enu) == 40
    assert_allclose(enu[:, 2], 510.0, atol=10.0)
    eo = dataset.simulated.truth.eo.position_m
    gap = np.linalg.norm(enu[:, None, :2] - eo[None, :, :2], axis=-1).min(axis=1)
    assert gap.max() < 60.0


def test_events_and_antenna_positions_belong_together(dataset):
    """Oracle: the truth file: antenna minus camera, turned into the camera, is the lever arm of
    Table 1; noise 2, 2, 3 cm.
    """
    names, tow = named(dataset.directory / "01_Observations/Camera/Data/Events.txt")
    images, antenna = named(
        dataset.directory / "02_Processed/GPS-PPK/AntennaPos_Img_WGS84_tangentplane.txt"
    )
    truth = np.load(dataset.directory / "truth/eo.npz")
    assert names == images == tuple(truth["images"].tolist())
    assert_allclose(tow, truth["tow"], rtol=0, atol=1e-7)
    lever = np.einsum("nji,nj->ni", truth["C_mc"], antenna - truth["position_enu"])
    assert_allclose(
        lever.mean(axis=0), [0.462, -0.001, -0.065], atol=4.0 * 0.03 / np.sqrt(len(lever))
    )


def test_truth_text_is_the_truth_of_the_arrays(dataset):
    """Oracle: R = Rx(omega) Ry(phi) Rz(kappa) written out, with a camera right-up-back; angles
    printed to 1e-6 deg.
    """
    truth = np.load(dataset.directory / "truth/eo.npz")
    names, table = named(dataset.directory / "truth/EO_local-plane.txt")
    assert names == tuple(truth["images"].tolist())
    assert_allclose(table[:, :3], truth["position_enu"], atol=6e-5)
    assert not table[:, 6:].any()
    (so, sp, sk), (co, cp, ck) = (
        np.sin(np.radians(table[:, 3:6])).T,
        np.cos(np.radians(table[:, 3:6])).T,
    )
    R = np.array(
        [
            [cp * ck, -cp * sk, sp],
            [co * sk + so * sp * ck, co * ck - so * sp * sk, -so * cp],
            [so * sk - co * sp * ck, so * ck + co * sp * sk, co * cp],
        ]
    )
    assert_allclose(np.moveaxis(R, -1, 0) * [1.0, -1.0, -1.0], truth["C_mc"], rtol=0, atol=3e-8)


def test_true_trajectory_is_whole(dataset):
    """Oracle: rates of the task; positions in rad near the site, biases as large as the model."""
    truth = np.load(dataset.directory / "truth/trajectory.npz")
    assert truth["tow"].shape == (901,)
    for name, shape in (
        ("v_ned", (901, 3)),
        ("C_nb", (901, 3, 3)),
        ("gyro_bias", (901, 3)),
        ("accel_bias", (901, 3)),
    ):
        assert truth[name].shape == shape
    assert_allclose(np.degrees(truth["lat"]), 46.57, atol=0.02)
    assert_allclose(truth["h"], 650.0, atol=60.0)
    assert 1e-6 < np.abs(truth["gyro_bias"]).max() < 3e-3
    fixes = numbers(dataset.directory / "02_Processed/GPS-PPK/AntennaPos_WGS84.txt")
    assert fixes.shape == (901, 7)
    assert_allclose(fixes[:, 3], truth["h"], atol=0.5)


def test_the_readers_of_the_package_take_it(dataset):
    """Oracle: the samples that were written, through the flight file and the readers that `process`
    uses.
    """
    flight = load_flight(dataset.flight_file)
    imu = read_imu_csv(
        flight.imu.file, ReadOptions(units=flight.imu.units, quantity=flight.imu.quantity)
    )
    assert_allclose(imu.gyro, dataset.simulated.imu.gyro, rtol=0, atol=1e-9)
    assert_allclose(imu.accel, dataset.simulated.imu.accel, rtol=0, atol=1e-8)
    fixes = read_gnss_text(flight.gnss.file)
    assert_allclose(fixes.cov_ned, dataset.simulated.gnss.cov_ned, rtol=1e-9)
    assert_allclose(fixes.lat, dataset.simulated.gnss.lat, rtol=0, atol=1e-12)
    assert read_events(flight.camera.events).images == dataset.simulated.events.images
    assert_allclose(
        flight.mounting.antenna_lever_b, dataset.simulated.rig.antenna_lever_b, rtol=0, atol=1e-12
    )
    assert_allclose(
        flight.mounting.camera_lever_b, dataset.simulated.rig.camera_lever_b, rtol=0, atol=1e-12
    )


def test_the_same_seed_writes_the_same_bytes(dataset, tmp_path):
    """Oracle: comparison of files; another seed gives others."""
    for seed, equal in ((3, True), (4, False)):
        other = write_dataset(tmp_path / str(seed), **{**SHORT, "seed": seed})
        for file in (
            "01_Observations/Camera/Data/Events.txt",
            "02_Processed/GPS-PPK/AntennaPos_Img_WGS84.txt",
        ):
            assert (
                (other.directory / file).read_bytes() == (dataset.directory / file).read_bytes()
            ) is equal


def test_increments_and_a_model_of_ones_own(tmp_path):
    """Oracle: definition: increments are rates times the interval; the written noise model reads
    back equal.
    """
    model = load_noise_model("consumer")
    d = write_dataset(
        tmp_path / "x", "ign6x1", **SHORT, noise=model, quantity="increments", gyro_unit="deg"
    )
    flight = tomllib.loads(d.flight_file.read_text())
    assert flight["imu"]["noise"] == "noise.toml"
    assert flight["imu"]["quantity"] == "increments"
    written = load_noise_model(d.directory / "noise.toml")
    assert (written.gyro, written.accel) == (model.gyro, model.accel)
    table = numbers(
        d.directory / "01_Observations/IMU/Data/Pre_calibrated/f6_1_sob.csv",
        delimiter=",",
        skiprows=1,
    )
    assert np.median(table[:, 6]) * 50.0 == pytest.approx(-9.81, abs=0.5)


def test_what_is_there_is_never_touched(tmp_path):
    """Oracle: the file system; a directory with content or a file is refused, an empty one is
    taken.
    """
    (tmp_path / "full").mkdir()
    (tmp_path / "full/mine.txt").write_text("mine")
    (tmp_path / "file").write_text("mine")
    for name in ("full", "file"):
        with pytest.raises(UsageError, match="not an empty directory"):
            write_dataset(tmp_path / name, **SHORT)
    assert (tmp_path / "full/mine.txt").read_text() == "mine"
    (tmp_path / "empty").mkdir()
    assert write_dataset(tmp_path / "empty", **SHORT).flight_file.is_file()


@pytest.mark.parametrize(
    ("changes", "error"),
    [
        ({"gyro_unit": "g"}, InputError),
        ({"accel_unit": "furlong"}, InputError),
        ({"imu_axes": "forward left down"}, UsageError),
        ({"minutes": 0.05}, UsageError),
        ({"noise": "no such model"}, InputError),
    ],
)
def test_a_refused_data_set_leaves_nothing(tmp_path, changes, error):
    """Oracle: the contract and an empty parent directory."""
    with pytest.raises(error):
        write_dataset(tmp_path / "x", **{**SHORT, **changes})
    assert list(tmp_path.iterdir()) == []


def test_a_failing_disk_leaves_nothing(tmp_path, monkeypatch):
    """Oracle: an error of the operating system half way; the message names the directory, nothing
    is left.
    """

    def full(*_args, **_options):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "savez", full)
    with pytest.raises(UsageError, match="No space left"):
        write_dataset(tmp_path / "x", **SHORT)
    assert list(tmp_path.iterdir()) == []
