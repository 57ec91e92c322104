"""Noise in flight of two IMUs on one drone, of which one shakes by more than its model says."""

import json
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from insgnss import Flight, cli, load_flight
from insgnss.base.errors import UsageError
from insgnss.noise.tuning.in_flight.estimation import tune_flight
from insgnss.noise.tuning.several import SeveralTuned, alone, tune_each
from insgnss.simulation.dataset import write_dataset
from insgnss.simulation.raw_gnss.receiver import GnssOptions
from insgnss.simulation.sensors import ImuOptions, SecondImu

RATE, SHAKEN = 100.0, 3.0
# m, of the second IMU from the camera: half a metre from the first, so that a wrong lever arm shows
PLACE = (0.113, 0.520, -0.300)


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> Flight:
    """Six minutes in the air; the first IMU as its model says, the second with thrice the white
    noise and turned about the vertical.
    """
    second = SecondImu(
        ImuOptions(RATE, "navchip", "backward left down", vibration=SHAKEN), imu_m=PLACE
    )
    gnss = GnssOptions(sigma_m=(0.005, 0.005, 0.008))
    options = {
        "imu_rate": RATE,
        "seed": 3,
        "gnss": gnss,
        "second_imu": second,
        "start_in_air": True,
        "line_length_m": 300.0,
    }
    file = write_dataset(
        tmp_path_factory.mktemp("pair") / "set", "ign8", 6.0, **options
    ).flight_file
    first = load_flight(file)
    (other,) = set(first.imu.file.parent.glob("*.csv")) - {first.imu.file}
    lever = first.mounting.C_cb.T @ (np.array(PLACE) - first.mounting.imu_m)
    more = (
        f'[[imu.further]]\nfile = "{other}"\naxes = "backward left down"\nlever_m ='
        f" {lever.tolist()}\n"
    )
    file.write_text(f"{file.read_text()}\n{more}")
    return load_flight(file)


@pytest.fixture(scope="module")
def tuned(pair: Flight) -> SeveralTuned:
    result = tune_each(pair)
    assert isinstance(result, SeveralTuned)
    return result


def test_each_imu_flies_alone_from_where_it_sits(pair):
    """Oracle: the rig of the simulation: where the second IMU sits and how it is turned; the first
    one's flight is as without the other.
    """
    first, second = alone(pair)
    assert not first.imu.further
    assert not second.imu.further
    assert first.imu == replace(pair.imu, further=())
    assert_allclose(first.mounting.imu_m, pair.mounting.imu_m, atol=1e-15)
    assert second.imu.axes == "backward left down"
    assert_allclose(second.mounting.imu_m, PLACE, atol=1e-6)
    lever = pair.mounting.antenna_lever_b - np.asarray(pair.imu.further[0].lever_m)
    assert_allclose(second.mounting.antenna_lever_b, lever, atol=1e-12)


@pytest.mark.slow
def test_the_imu_that_shakes_is_the_one_that_is_told(tuned):
    """Oracle: the simulator's factors, one and three, within three standard errors of at most 20 %;
    a wrong lever arm would shift both.
    """
    for one, truth in zip(tuned.tuned, (1.0, SHAKEN), strict=True):
        assert_allclose(
            np.log(one.noise.factor[:2]), np.log(truth), atol=3.0 * one.noise.log_sigma[:2].max()
        )
        assert one.noise.log_sigma[:2].max() < 0.2
    assert [one.accepted for one in tuned.tuned] == [False, True]


@pytest.mark.slow
def test_the_first_is_tuned_as_without_the_second(pair, tuned, tmp_path):
    """Oracle: the same flight file without [[imu.further]], to the rounding of a bore-sight that is
    made a rotation once more.
    """
    single = tune_flight(replace(pair, imu=replace(pair.imu, further=())), tmp_path / "noise.toml")
    assert_allclose(tuned.tuned[0].noise.factor, single.noise.factor, rtol=1e-6)


@pytest.mark.slow
def test_files_and_words_say_which_imu(pair, tuned):
    """Oracle: the contract: a table an IMU, a model where it is accepted, the key that takes it;
    two of everything in JSON.
    """
    folder = pair.path.parent
    assert not (folder / "in_flight_noise.toml").exists()
    assert (folder / "in_flight_noise.json").exists()
    model = tomllib.loads((folder / "in_flight_noise_2.toml").read_text())
    assert model["recording"][0]["file"] == pair.imu.further[0].file.name
    text = tuned.summary()
    assert 'imu.further[1].noise = "in_flight_noise_2.toml"' in text
    assert "each IMU was tuned alone" in text
    told = json.loads(json.dumps(tuned.as_dict()))
    assert [imu["verdict"] for imu in told["imus"]] == ["keep", "accept"]


@pytest.mark.slow
def test_nothing_is_done_where_a_file_is_in_the_way(pair, tuned, capsys):
    """Oracle: the bytes of the second IMU's model, and the exit code of the contract; also where
    the model would replace an input.
    """
    kept = Path(pair.path.parent / "in_flight_noise_2.toml")
    before = kept.read_bytes()
    for beside in ("in_flight_noise.json", "in_flight_noise.html"):
        (pair.path.parent / beside).unlink()
    assert cli.main(["tune", "--flight", str(pair.path), "-q"]) == 2
    assert "in_flight_noise_2." in capsys.readouterr().err
    assert kept.read_bytes() == before
    assert not (pair.path.parent / "in_flight_noise.json").exists()
    mine = replace(pair, imu=replace(pair.imu, further=(replace(pair.imu.further[0], noise=kept),)))
    with pytest.raises(UsageError, match="input of this flight"):
        tune_each(mine, force=True)
