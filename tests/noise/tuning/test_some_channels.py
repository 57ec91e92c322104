"""Static recordings of some channels, tables by name, and directories that are not there yet."""

from pathlib import Path

import numpy as np
import pytest
from static_files import RATE, samples

from insgnss.base.errors import UsageError
from insgnss.cli import main
from insgnss.noise.tuning.options import TuneOptions
from insgnss.noise.tuning.recordings import read_samples
from insgnss.noise.tuning.some_channels import PER_AXIS, chosen_channels

VALUES = samples(4, 2.0)
TIME = np.arange(len(VALUES)) / RATE
SI = {"gyro_unit": "rad/s", "accel_unit": "m/s^2"}
TUNE = ["tune", "--model", "WN", "--accept", "length", "-q"]


def table(path: Path, head: str, *columns: np.ndarray) -> Path:
    rows = "\n".join(",".join(f"{x:.12g}" for x in row) for row in np.column_stack(columns))
    path.write_text(f"{head}\n{rows}\n")
    return path


def test_what_a_file_lacks_is_no_channel(tmp_path: Path) -> None:
    """Oracle: the columns written, in their own units and places."""
    deg = np.degrees(VALUES[:, 2])
    cases = [
        (table(tmp_path / "z.csv", "time[s],gz[deg/s]", TIME, deg), TuneOptions(), [2]),
        (
            table(tmp_path / "two.csv", "tow,ay,gx", 1e3 * TIME, VALUES[:, 4], VALUES[:, 0]),
            TuneOptions(**SI, time_unit="ms"),
            [0, 4],
        ),
        (
            table(tmp_path / "g.csv", "# gyros", *VALUES[:, :3].T),
            TuneOptions(columns=("gx", "gy", "gz"), rate_hz=RATE, gyro_unit="rad/s"),
            [0, 1, 2],
        ),
    ]
    np.save(tmp_path / "a.npy", VALUES[:, 3:])
    options = TuneOptions(columns=("ax", "ay", "az"), rate_hz=RATE, accel_unit="m/s^2")
    cases.append((tmp_path / "a.npy", options, [3, 4, 5]))
    for path, options, there in cases:
        imu, channels = read_samples(path, options)
        assert [k for k in range(6) if channels[k]] == there, path
        read = np.hstack([imu.gyro, imu.accel])
        np.testing.assert_allclose(read[:, there], VALUES[:, there], rtol=1e-9, atol=1e-11)
        others = [k for k in range(6) if k not in there]
        assert np.ptp(read[:, others], axis=0).max() == 0.0
        np.testing.assert_allclose(np.diff(imu.time), 1.0 / RATE, atol=1e-9)


def test_nothing_says_the_unit_of_the_one_axis(tmp_path: Path) -> None:
    """Oracle: the option that is missing; that of the sensor that is not there is not asked for."""
    path = table(tmp_path / "z.csv", "time[s],gz", TIME, VALUES[:, 2])
    with pytest.raises(
        UsageError, match="neither the file nor an option states the unit of the gyro columns"
    ):
        read_samples(path, TuneOptions())
    assert [*read_samples(path, TuneOptions(gyro_unit="rad/s"))[1]] == [k == 2 for k in range(6)]


def test_a_variable_of_a_mat_file_by_its_name(tmp_path: Path) -> None:
    """Oracle: the matrix saved; seven columns begin with time, six have a rate."""
    savemat = pytest.importorskip("scipy.io").savemat
    other = np.ones((len(VALUES), 4))
    content = {"six": VALUES, "seven": np.column_stack([TIME, VALUES]), "other": other}
    savemat(tmp_path / "x.mat", content)
    for options in (
        TuneOptions(variable="six", rate_hz=RATE, **SI),
        TuneOptions(variable="seven", **SI),
    ):
        imu, channels = read_samples(tmp_path / "x.mat", options)
        assert all(channels)
        np.testing.assert_allclose(np.hstack([imu.gyro, imu.accel]), VALUES)


@pytest.mark.parametrize("only", [None, "gyro", "accel_z", "gyro_y, accel"])
def test_names_of_channels(only: str | None) -> None:
    """Oracle: the names."""
    chosen = [name for name, there in zip(PER_AXIS, chosen_channels(only), strict=True) if there]
    expected = {
        "gyro": PER_AXIS[:3],
        "accel_z": PER_AXIS[5:],
        "gyro_y, accel": (PER_AXIS[1], *PER_AXIS[3:]),
    }
    assert tuple(chosen) == expected.get(only or "", PER_AXIS)


@pytest.mark.slow
def test_one_axis_is_tuned_into_a_directory_that_is_made(tmp_path: Path) -> None:
    """Oracle: white noise of 10 deg/h/sqrt(Hz) that was simulated, at the finest scales."""
    path = table(tmp_path / "z.csv", "time[s],gz[rad/s]", TIME, VALUES[:, 2])
    out = tmp_path / "new" / "deep" / "z.toml"
    assert main([*TUNE, str(path), "--out", str(out), "--levels", "1-5"]) == 0
    assert {file.name for file in out.parent.iterdir()} == {"z.json", "z.html"}
    np.save(tmp_path / "all.npy", VALUES)
    units = ["--rate", "50", "--gyro-unit", "rad/s", "--accel-unit", "m/s^2", "--only", "accel_x"]
    out = tmp_path / "x" / "x.toml"
    argv = [*TUNE, str(tmp_path / "all.npy"), *units, "--out", str(out), "--levels", "1-5"]
    for _ in range(2):  # the same recording again, without --force
        assert main(argv) == 0
    assert {file.name for file in out.parent.iterdir()} == {"x.json", "x.html"}
    assert "all six axes, and gyro x y z, accel y z were not tuned; x.json has" in out.with_suffix(
        ".json"
    ).read_text(encoding="utf-8")
    out.with_suffix(".json").unlink()
    assert main(argv) == 2  # files that no tuning owns
