"""Readings of left-handed axes, which the test makes of simulated ones: two axes exchanged in gyros
and accelerometers alike, or signs reversed in both. The advice is followed to the letter.
"""

import re
import tomllib
from dataclasses import replace

import numpy as np
import pytest

from insgnss.cli import main
from insgnss.geodesy.axes import parse_axes
from insgnss.io.formats.imu.exchanged_columns import exchanged_columns
from insgnss.navigation.recognise.claims import compare
from insgnss.navigation.recognise.handedness import AXIS_PAIRS, exchange_axes, with_exchanges
from insgnss.navigation.recognise.recognition import recognise
from insgnss.simulation.dataset import write_dataset
from insgnss.simulation.scenario import GnssOptions, ImuOptions, simulate_flight

IMU = "01_Observations/IMU/Data/Pre_calibrated/f8_1_sob.csv"
IDS = ["xy", "xz", "yz"]


@pytest.fixture(scope="module")
def flown():
    flight = simulate_flight(
        "ign8",
        3.0,
        seed=11,
        imu=ImuOptions(rate_hz=100.0),
        gnss=GnssOptions(),
        start_in_air=True,
    )
    return flight.imu, flight.gnss


def compared(imu, gnss, C_b_imu=None, accel_sign=1):
    """The checks of axes and sign, of samples as the claims make them."""
    claimed = replace(imu, accel=accel_sign * imu.accel)
    found = with_exchanges(recognise(claimed, gnss), claimed, gnss, recognise, accel_sign)
    checks = compare(found, np.eye(3) if C_b_imu is None else C_b_imu, accel_sign=accel_sign)
    return {check.name: check for check in checks}


@pytest.mark.parametrize("pair", AXIS_PAIRS, ids=IDS)
def test_the_exchange_that_explains_the_motion_is_named(flown, pair):
    """Oracle: the exchange that the test made; its remedy is its own reverse. The sign of the force
    is no contradiction then, and nobody is sent to reverse it.
    """
    imu, gnss = flown
    checks = compared(exchange_axes(imu, pair), gnss)
    a, b = ("xyz"[k] for k in pair)
    axes, sign = checks["recognised axes"], checks["recognised sign"]
    assert axes.verdict == "contradiction"
    assert axes.found.startswith(f"{a} and {b} are exchanged in gyro and accelerometer alike:")
    assert axes.advice == f"exchange the names g{a} and g{b}, and a{a} and a{b}, in imu.columns"
    assert sign.verdict == "note"
    assert "accel_sign" not in f"{axes.advice} {sign.advice}"


def test_the_way_out_of_a_wrong_remedy(flown):
    """Oracle: the exchange that the test made, whose reversed force the flight file claims with the
    axes that gravity then suggests.
    """
    imu, gnss = flown
    axes = compared(exchange_axes(imu, (0, 1)), gnss, parse_axes("forward left up"), -1)[
        "recognised axes"
    ]
    assert axes.verdict == "contradiction"
    assert 'imu.accel_sign = 1, with imu.axes = "forward right down"' in axes.advice


@pytest.mark.parametrize(
    ("signs", "words"),
    [
        ([1.0, -1.0, 1.0], "gyro and accelerometer of y have the reversed sign"),
        ([-1.0, -1.0, -1.0], "all six readings have the reversed sign"),
    ],
)
def test_signs_reversed_in_both_triads_are_no_exchange(flown, signs, words):
    """Oracle: the signs that the test reversed; and the advice, followed, agrees with the data."""
    imu, gnss = flown
    wrong = replace(imu, gyro=imu.gyro * signs, accel=imu.accel * signs)
    axes = compared(wrong, gnss)["recognised axes"]
    assert axes.found.startswith(words)
    words = re.search(r'imu\.axes = "([^"]+)"', axes.advice).group(1)
    a, b = re.match(r"exchange the names g(.) and g(.),", axes.advice).groups()
    followed = exchange_axes(wrong, ("xyz".index(a), "xyz".index(b)))
    checks = compared(followed, gnss, parse_axes(words))
    assert [check.verdict for check in checks.values()][1:3] == ["ok", "ok"]


@pytest.mark.parametrize(("reverse", "claim"), [(-1.0, 1), (1.0, -1)])
def test_a_reversed_force_keeps_its_own_advice(flown, reverse, claim):
    """Oracle: the sign that the test gave the force, or the claim."""
    imu, gnss = flown
    wrong = replace(imu, accel=reverse * imu.accel)
    checks = compared(wrong, gnss, accel_sign=claim)
    assert checks["recognised axes"].verdict == "ok"
    assert checks["recognised sign"].verdict == "contradiction"
    assert f"imu.accel_sign = {-claim};" in checks["recognised sign"].advice


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    root = tmp_path_factory.mktemp("handedness") / "good"
    write_dataset(root, "ign8", 2.5, imu_rate=100.0, seed=11, start_in_air=True)
    return root


def spoiled(good, tmp_path, columns, signs=(1.0,) * 6):
    """A copy of the data set whose IMU file has its columns in another order, or other signs."""
    import shutil

    root = tmp_path / "ign8"
    shutil.copytree(good, root, ignore=lambda _, names: {"truth", "GCPs"} & set(names))
    header, *_ = (root / IMU).read_text().splitlines()
    values = np.loadtxt(root / IMU, delimiter=",", skiprows=1)
    values[:, 1:] = values[:, columns] * signs
    np.savetxt(root / IMU, values, "%.9f", ",", header=header, comments="")
    return root


@pytest.mark.parametrize(
    ("columns", "signs"),
    [
        ([2, 1, 3, 5, 4, 6], (1.0,) * 6),
        pytest.param([1, 3, 2, 4, 6, 5], (1.0,) * 6, marks=pytest.mark.slow),
        pytest.param([3, 2, 1, 6, 5, 4], (1.0,) * 6, marks=pytest.mark.slow),
        pytest.param([1, 2, 3, 4, 5, 6], (-1.0,) * 6, marks=pytest.mark.slow),
        ([1, 2, 3, 4, 5, 6], (1.0, 1.0, 1.0, -1.0, -1.0, -1.0)),
    ],
    ids=["xy", "yz", "xz", "six", "force"],
)
def test_the_printed_advice_leads_to_a_result(good, tmp_path, capsys, columns, signs):
    """Oracle: exit codes; what the first line advises is put into the flight file as it is."""
    root = spoiled(good, tmp_path, columns, signs)
    path = root / "flight.toml"
    assert main(["process", str(path)]) == 3
    advice = capsys.readouterr().err.strip().splitlines()[-1]
    advised = dict(re.findall(r'imu\.(\w+) = (\[[^]]*\]|"[^"]*"|-?1)', advice))
    text = path.read_text()
    for key, value in advised.items():
        text = re.sub(rf"(?m)^{key} = .*\n", "", text)
        text = text.replace("[imu]\n", f"[imu]\n{key} = {value}\n")
    path.write_text(text)
    assert set(tomllib.loads(text)["imu"]) > set(advised) > set()
    assert main(["inspect", str(path)]) == 0
    assert "BAD" not in capsys.readouterr().out
    assert main(["process", str(path)]) == 0


def test_a_draft_of_left_handed_samples_is_processed(good, tmp_path, capsys):
    """Oracle: the exchange that the test made, and the exit code of what is drafted."""
    root = spoiled(good, tmp_path, [2, 1, 3, 5, 4, 6])
    files = [str(root / IMU), str(root / "02_Processed/GPS-PPK/AntennaPos_WGS84.txt")]
    path = tmp_path / "drafted.toml"
    assert main(["inspect", *files, "--write", str(path), "-q"]) == 0
    draft = tomllib.loads(path.read_text())["imu"]
    assert draft["columns"] == ["tow", "gy", "gx", "gz", "ay", "ax", "az"]
    assert draft["axes"] == "forward right down"
    assert "accel_sign" not in draft
    assert main(["process", str(path)]) == 0


def test_columns_of_every_kind_are_exchanged(tmp_path):
    """Oracle: the names exchanged by hand."""
    path = tmp_path / "imu.csv"
    row = "1,2,3,4,5,6,7,8\n2,2,3,4,5,6,7,8\n"
    path.write_text(f"time,temperature,gx,gy,gz,ax,ay,az\n{row}")
    given = {"tow": "time", "gx": "a", "gy": "b", "gz": "c", "ax": "d", "ay": "e", "az": "f"}
    exchange = exchanged_columns(path, (1, 2), given)
    assert exchange == given | {"gy": "c", "gz": "b", "ay": "f", "az": "e"}
    listed = ["tow", "-", "gx", "gy", "gz", "ax", "ay", "az"]
    wanted = ["tow", "-", "gz", "gy", "gx", "az", "ay", "ax"]
    assert exchanged_columns(path, (0, 2), listed) == wanted
    assert exchanged_columns(path, (0, 2)) == ["tow", "temperature", *wanted[2:]]
    path.write_text("$AIMU,1\n")
    assert exchanged_columns(path, (0, 1)) is None
