"""What `tune` makes of files as people have them: clocks, units, names, several IMUs; every message
in the words of its options.
"""

import json

import numpy as np
import pytest
from static_files import RATE, samples, save

import insgnss
from insgnss import cli
from insgnss.base.errors import InputError, UsageError
from insgnss.base.wording import spoken_as
from insgnss.io.formats import read_imu
from insgnss.noise.tuning.options import TuneOptions
from insgnss.noise.tuning.recordings import OPTION_NAMES, read_samples

UNITS = ["--gyro-unit", "rad/s", "--accel-unit", "m/s^2"]
HEAD = "gx[rad/s],gy[rad/s],gz[rad/s],ax[m/s^2],ay[m/s^2],az[m/s^2]"


@pytest.fixture(scope="module")
def rest():
    """Two minutes at rest, (n, 6)."""
    return samples(4, 2)


def table(path, time, values, header, delimiter=","):
    np.savetxt(
        path,
        np.column_stack([time, values]),
        fmt="%.17g",
        delimiter=delimiter,
        header=header,
        comments="",
    )
    return path


def run(capsys, *argv):
    """Exit code and what was said, output or the line of the error."""
    code = cli.main(["tune", *map(str, argv), "--model", "WN", "--weights", "diagonal", "-q"])
    said = capsys.readouterr()
    return code, said.err if code else said.out


@pytest.mark.parametrize(("unit", "factor"), [("ms", 1e3), ("us", 1e6)])
def test_stamps_of_another_unit_are_read_as_inspect_reads_them(
    rest, tmp_path, capsys, unit, factor
):
    """Oracle: 50 Hz put in; stamps in the other unit under the name `time` are read with a note
    that says the unit, and with --time-unit without one.
    """
    path = table(tmp_path / "t.csv", np.arange(len(rest)) * factor / RATE, rest, f"time,{HEAD}")
    for named in ((), ("--time-unit", unit)):
        code, said = run(capsys, path, *named, "--out", tmp_path / "x.toml", "--force")
        assert code == 0
        assert "6000 samples at 50 Hz, 2.0 min" in said
        assert (f"IMU time: {unit}" in said) == (not named)


def test_clocks_by_other_names_and_named_fields_need_no_columns(rest, tmp_path):
    """Oracle: the samples put in, from each of four layouts."""
    t = np.arange(len(rest)) / RATE
    record = np.zeros(
        len(rest),
        dtype=[
            (name, float)
            for name in ("time", "gyro_x", "gyro_y", "gyro_z", "acc_x", "acc_y", "acc_z")
        ],
    )
    for name, column in zip(record.dtype.names, np.column_stack([t, rest]).T, strict=True):
        record[name] = column
    long = (
        "GPS time of week (s),"
        + ",".join(f"Gyro {c} (rad/s)" for c in "XYZ")
        + ","
        + ",".join(f"Accel {c} (m/s^2)" for c in "XYZ")
    )
    given = TuneOptions(gyro_unit="rad/s", accel_unit="m/s^2")
    for path, options in (
        (
            table(tmp_path / "us.csv", 1e9 + t * 1e6, rest, "timestamp_us;wx;wy;wz;ax;ay;az", ";"),
            given,
        ),
        (table(tmp_path / "long.csv", 1000.0 + t, rest, long), TuneOptions()),
        (
            table(
                tmp_path / "camel.csv",
                t * 1e3,
                rest,
                "SysClockMs,gyro_x_rps,gyro_y_rps,gyro_z_rps,acc_x_ms2,acc_y_ms2,acc_z_ms2",
            ),
            TuneOptions(),
        ),
        (save(tmp_path / "record.npy", record), given),
    ):
        imu, _ = read_samples(path, options)
        assert imu.notes == ()
        np.testing.assert_allclose(imu.time - imu.time[0], t, rtol=0, atol=1e-6)
        np.testing.assert_allclose(np.column_stack([imu.gyro, imu.accel]), rest, rtol=1e-12)


def test_a_unit_against_the_header_is_reported(rest, tmp_path, capsys):
    """Oracle: the header says rad/s, the option deg/s; noise is 57 times too small, and the output
    says why.
    """
    path = table(tmp_path / "t.csv", np.arange(len(rest)) / RATE, rest, f"time,{HEAD}")
    code, said = run(capsys, path, "--gyro-unit", "deg/s", "--out", tmp_path / "x.toml")
    assert code == 0
    assert "the header says rad/s, and --gyro-unit deg/s was taken" in said
    code, said = run(capsys, path, "--gyro-unit", "rad/s", "--out", tmp_path / "y.toml")
    assert code == 0
    assert "the header says" not in said


def test_units_behind_names_need_no_option(rest, tmp_path, capsys):
    """Oracle: the samples put in, from numbers in deg/s and mg; an option to the contrary is told
    in the words of the options.
    """
    t, counts = np.arange(len(rest)) / RATE, rest / [*[np.pi / 180.0] * 3, *[9.80665e-3] * 3]
    path = table(
        tmp_path / "t.csv",
        1e6 * t,
        counts,
        "clock_us,gyro_x_dps,gyro_y_dps,gyro_z_dps,acc_x_mg,acc_y_mg,acc_z_mg",
    )
    imu, _ = read_samples(path, TuneOptions())
    np.testing.assert_allclose(np.column_stack([imu.gyro, imu.accel]), rest, rtol=1e-12)
    np.testing.assert_allclose(imu.time, t, rtol=0, atol=1e-9)
    code, said = run(capsys, path, "--gyro-unit", "deg/h", "--out", tmp_path / "x.toml")
    assert code == 0
    assert (
        "IMU units: the header says deg/s, and --gyro-unit deg/h was taken; leave --gyro-unit out"
        " if the header is right" in said
    )
    path = table(
        tmp_path / "angles.csv",
        t,
        rest,
        "time,gyro_x_deg,gyro_y_deg,gyro_z_deg,acc_x_g,acc_y_g,acc_z_g",
    )
    code, said = run(capsys, path, "--out", tmp_path / "y.toml")
    assert code == 2
    assert (
        "neither the file nor an option states the unit of the gyro columns; give --gyro-unit"
        in said
    )


def test_another_imu_is_not_pooled(rest, tmp_path, capsys):
    """Oracle: noise twenty times that of the other put in; refused with the factor, and a word to
    the contrary is taken.
    """
    mean = rest.mean(axis=0)
    quiet, other = samples(5, 2), save(tmp_path / "other.npy", mean + 20.0 * (rest - mean))
    argv = [
        save(tmp_path / "quiet.npy", quiet),
        other,
        *UNITS,
        "--rate",
        RATE,
        "--out",
        tmp_path / "x.toml",
    ]
    code, said = run(capsys, *argv)
    assert code == 4
    assert "other.npy: gyro x has 20" in said or "other.npy: gyro x has 19" in said
    assert "times the noise of quiet.npy" in said
    assert not (tmp_path / "x.toml").exists()
    assert (
        run(capsys, *argv, "--accept", "pooling", "--accept", "motion", "--accept", "units")[0] == 0
    )


def test_files_stand_behind_options_and_columns_begin_with_a_minus(rest, tmp_path, capsys):
    """Oracle: the same command with the files in front; the first column left out is time."""
    one, two = save(tmp_path / "one.npy", rest), save(tmp_path / "two.npy", samples(5, 2))
    code, said = run(
        capsys, one, "--rate", RATE, *UNITS, "--skip", "0", two, "--out", tmp_path / "x.toml"
    )
    assert code == 0
    assert "one.npy: 6000 samples" in said
    assert "two.npy: 6000 samples" in said
    path = table(tmp_path / "t.csv", np.arange(len(rest)), rest, f"count,{HEAD}")
    code, said = run(
        capsys,
        path,
        "--columns",
        "-,gx,gy,gz,ax,ay,az",
        "--rate",
        RATE,
        "--out",
        tmp_path / "y.toml",
    )
    assert code == 0


def test_messages_speak_of_options(rest, tmp_path, capsys):
    """Oracle: the verb's own options; none of a flight file's keys in what is said."""
    path = table(tmp_path / "t.csv", np.arange(len(rest)) / RATE, rest, f"count,{HEAD}")
    code, said = run(capsys, path, "--out", tmp_path / "x.toml")
    assert code == 3
    assert "--columns NAMES" in said
    assert "columns = [" not in said
    with pytest.raises(InputError, match=r"set columns = \[\.\.\.\] of .* or columns = \{ tow = "):
        read_imu(path)
    with spoken_as(OPTION_NAMES), pytest.raises(InputError) as refusal:
        read_imu(path)
    assert "set --columns NAMES of" in str(refusal.value)
    assert "or --columns tow=NAME,gx=NAME,..." in str(refusal.value)
    member = {
        "freq": 100,
        "n": 1000,
        "type": ["Gyroscope"],
        "axis": ["X"],
        "wvar": {"x": {"variance": [1.0], "scales": [0.02]}},
    }
    several = tmp_path / "several.json"
    several.write_text(json.dumps({"one": member, "two": member}))
    code, said = run(capsys, several, *UNITS, "--out", tmp_path / "x.toml")
    assert code == 2
    assert "set --variable to one of one, two" in said
    code, said = run(
        capsys, several, *UNITS, "--variable", "one", "--rate", "100", "--out", tmp_path / "x.toml"
    )
    assert code == 2
    assert "the file of variances states its rate; leave --rate out" in said
    own = tmp_path / "own.json"
    own.write_text('{\n "recordings": [\n  {"file": "a.npy"}]}')
    code, said = run(capsys, own, *UNITS, "--out", tmp_path / "x.toml")
    assert code == 3
    assert "is the table that insgnss tune wrote" in said


def test_a_drift_beside_others_is_not_tried(rest, tmp_path, capsys):
    """Oracle: a drift is no noise, so white noise is chosen."""
    argv = [
        save(tmp_path / "one.npy", rest),
        "--rate",
        RATE,
        *UNITS,
        "--gyro-model",
        "DR,WN",
        "--out",
        tmp_path / "x.toml",
    ]
    code, said = run(capsys, *argv)
    assert code == 0
    assert "no noise at all: DR" in said


def test_arrays_are_no_recordings():
    """Oracle: the docstring; the message names what to do."""
    for given in (np.zeros((9, 7)), [np.zeros((9, 7))]):
        with pytest.raises(UsageError, match=r"tune: ndarray is not a path .*np\.save"):
            insgnss.tune(given)
