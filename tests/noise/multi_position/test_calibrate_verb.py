"""`insgnss calibrate imu`: from a file to a file."""

import json
from pathlib import Path

import numpy as np
import pytest
from turned import ACCEL, FACES, GRAVITY, GYRO, positions, recorded, turned_by_hand
from written import write_imu_csv

from insgnss.cli import main
from insgnss.navigation.prepare.calibration import load_calibration
from insgnss.records import ImuSamples


def recording(path: Path, count: int) -> ImuSamples:
    """Write a recording in `count` positions at 100 Hz."""
    imu = recorded(
        turned_by_hand(positions(count) if count > len(FACES) else FACES[:count], hold_s=4.0), 1
    )
    write_imu_csv(imu, path)
    return imu


def test_from_a_recording_to_a_file_and_back(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Oracle: the error model of the recording, four standard errors; WGS84 gravity at 46.5 deg and
    400 m, 9.80756 - 400 x 3.086e-6.
    """
    imu = recording(tmp_path / "hand.csv", 18)
    assert (
        main(
            [
                "calibrate",
                "imu",
                str(tmp_path / "hand.csv"),
                "--latitude",
                "46.5",
                "--height",
                "400",
                "--quiet",
            ]
        )
        == 0
    )
    text = capsys.readouterr().out
    assert "gravity 9.8063" in text
    assert "accel  bias x" in text
    assert text.split()[-2:] == [str(tmp_path / f"calibration.{end}") for end in ("toml", "json")]
    made = json.loads((tmp_path / "calibration.json").read_text())
    assert set(made["inputs_sha256"]) == {"hand.csv"}
    assert set(made["products_sha256"]) == {"calibration.toml"}
    got = load_calibration(tmp_path / "calibration.toml")
    for triad, truth in ((got.accel, ACCEL), (got.gyro, GYRO)):
        assert (np.abs(triad.bias - truth.bias) < 4.0 * triad.bias_sigma).all()
        assert (np.abs(triad.response - truth.response) <= 4.0 * triad.response_sigma).all()
    still = slice(0, 300)
    force = got.apply(imu).accel[still].mean(axis=0)
    np.testing.assert_allclose(force, [0.0, 0.0, -GRAVITY], atol=2e-3)


def test_json_has_every_parameter(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Oracle: the list of the model's parameters, nine and twelve."""
    recording(tmp_path / "hand.csv", 12)
    out = tmp_path / "c.toml"
    assert main(["calibrate", "imu", str(tmp_path / "hand.csv"), "--json", "--out", str(out)]) == 0
    document = json.loads(capsys.readouterr().out)
    assert len(document["accel"]["parameters"]) == 9
    assert len(document["gyro"]["parameters"]) == 12
    assert document["file"] == str(out)
    assert out.is_file()


def test_too_few_positions_end_with_four(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Oracle: the design's exit codes; nothing is written."""
    recording(tmp_path / "hand.csv", 5)
    assert main(["calibrate", "imu", str(tmp_path / "hand.csv"), "--quiet"]) == 4
    assert "5 positions found in 5 stationary periods, 9 needed" in capsys.readouterr().err
    assert not (tmp_path / "calibration.toml").exists()


def test_columns_and_units_are_said_on_the_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Oracle: the same recording in deg/s and g, columns in another order."""
    recording(tmp_path / "hand.csv", 12)
    table = np.loadtxt(tmp_path / "hand.csv", delimiter=",", skiprows=1)
    other = np.column_stack([table[:, 0], table[:, 4:7] / 9.80665, np.degrees(table[:, 1:4])])
    np.savetxt(tmp_path / "other.csv", other, delimiter=",", fmt="%.9f")
    options = [
        "--columns",
        "tow,ax,ay,az,gx,gy,gz",
        "--gyro-unit",
        "deg/s",
        "--accel-unit",
        "g",
        "--quiet",
    ]
    for name, more in (("hand.csv", ["--quiet"]), ("other.csv", options)):
        assert (
            main(
                [
                    "calibrate",
                    "imu",
                    str(tmp_path / name),
                    "--out",
                    str(tmp_path / f"{name}.toml"),
                    *more,
                ]
            )
            == 0
        )
    a, b = (load_calibration(tmp_path / f"{name}.toml") for name in ("hand.csv", "other.csv"))
    np.testing.assert_allclose(a.accel.response, b.accel.response, atol=1e-6)
    np.testing.assert_allclose(a.gyro.bias, b.gyro.bias, atol=1e-8)


def test_a_unit_against_the_header_is_reported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Oracle: the header says m/s^2, the option mg: a line of what is printed, of the JSON and of
    the file says both.
    """
    recording(tmp_path / "hand.csv", 12)
    table = np.loadtxt(tmp_path / "hand.csv", delimiter=",", skiprows=1) / [
        1,
        1,
        1,
        1,
        *[9.80665e-3] * 3,
    ]
    np.savetxt(
        tmp_path / "mg.csv",
        table,
        delimiter=",",
        fmt="%.9f",
        header="tow,gx,gy,gz,ax_m_s2,ay_m_s2,az_m_s2",
        comments="",
    )
    told = "IMU units: the header says m/s^2, and --accel-unit mg was taken"
    assert main(["calibrate", "imu", str(tmp_path / "mg.csv"), "--accel-unit", "mg", "--json"]) == 0
    assert any(told in note for note in json.loads(capsys.readouterr().out)["notes"])
    assert told in (tmp_path / "calibration.toml").read_text()


def test_wrong_use_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Oracle: the design's exit codes."""
    recording(tmp_path / "hand.csv", 5)
    file = str(tmp_path / "hand.csv")
    assert main(["calibrate", "imu", file, "--latitude", "465"]) == 2
    assert "--latitude 465.0: must be -90 to 90 deg" in capsys.readouterr().err
    assert main(["calibrate", "imu", file, "--flight", file, "--gyro-unit", "deg/s"]) == 2
    assert "remove these options" in capsys.readouterr().err
    assert main(["calibrate", "imu", file, "--gyro-unit", "furlong"]) in (2, 3)
    assert main(["calibrate", "imu", str(tmp_path / "none.csv")]) == 3


def test_the_flight_file_says_how_to_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Oracle: the recording written as increments, which only the flight file says."""
    recording(tmp_path / "hand.csv", 12)
    table = np.loadtxt(tmp_path / "hand.csv", delimiter=",", skiprows=1)
    imu = ImuSamples(table[:, 0], table[:, 1:4] / 100.0, table[:, 4:7] / 100.0, "increments")
    write_imu_csv(imu, tmp_path / "summed.csv")
    (tmp_path / "gnss.txt").write_text(
        "tow lat lon h sd_n sd_e sd_u\n1 46 6 400 1 1 1\n2 46 6 400 1 1 1\n"
    )
    (tmp_path / "flight.toml").write_text(
        '[imu]\nfile = "summed.csv"\nquantity = "increments"\n[gnss]\nfile = "gnss.txt"\n'
    )
    assert (
        main(
            [
                "calibrate",
                "imu",
                str(tmp_path / "summed.csv"),
                "--flight",
                str(tmp_path / "flight.toml"),
                "--quiet",
            ]
        )
        == 0
    )
    got = load_calibration(tmp_path / "calibration.toml")
    assert (np.abs(got.gyro.bias - GYRO.bias) < 4.0 * got.gyro.bias_sigma).all()
