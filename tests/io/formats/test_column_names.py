"""Columns as other tools name and write them: indices, signs, texts beside numbers, clocks in two
columns, other accuracies.
"""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from insgnss.base.errors import InputError
from insgnss.io.formats import read_gnss, read_imu

PX4 = (
    "timestamp,gyro_rad[0],gyro_rad[1],gyro_rad[2],accelerometer_m_s2[0],"
    "accelerometer_m_s2[1],accelerometer_m_s2[2]\n"
)
GYRO = {name: f"gyro_rad[{k}]" for k, name in enumerate(("gx", "gy", "gz"))}
ACCEL = {name: f"accelerometer_m_s2[{k}]" for k, name in enumerate(("ax", "ay", "az"))}
PX4_COLUMNS = {"tow": "timestamp"} | GYRO | ACCEL


def text(tmp_path: Path, content: str, name: str = "imu.csv") -> Path:
    path = tmp_path / name
    path.write_text(content)
    return path


def test_an_index_in_brackets_is_part_of_the_name(tmp_path: Path) -> None:
    """Oracle: the numbers of the file, whose header is that of pyulog's ulog2csv."""
    path = text(tmp_path, PX4 + "".join(f"{10.0 + k},1,2,3,4,5,6\n" for k in range(3)))
    imu = read_imu(path, columns=PX4_COLUMNS)
    assert imu.gyro.tolist() == [[1.0, 2.0, 3.0]] * 3
    assert imu.accel.tolist() == [[4.0, 5.0, 6.0]] * 3


def test_text_in_a_column_that_is_not_taken_is_of_no_account(tmp_path: Path) -> None:
    """Oracle: the numbers beside the text; and where a column that is taken holds text, its line
    and field.
    """
    rows = [f"{10 + k},imu link,,1,2,3,4,5,{6 + k},nan\n" for k in range(3)]
    head = "tow,frame_id,empty,gx,gy,gz,ax,ay,az,temperature\n"
    imu = read_imu(text(tmp_path, head + "".join(rows)))
    assert imu.accel[:, 2].tolist() == [6.0, 7.0, 8.0]
    with pytest.raises(InputError, match=r":3: 'x' in field 4 where a finite number must stand"):
        read_imu(text(tmp_path, head + rows[0] + rows[1].replace(",1,", ",x,") + rows[2]))


def test_text_between_blanks_keeps_the_columns_apart(tmp_path: Path) -> None:
    """Oracle: the numbers beside the text, in columns apart by blanks."""
    imu = read_imu(
        text(
            tmp_path,
            "tow status gx gy gz ax ay az\n"
            + "".join(f"{10 + k}   OK 1 2 3 4 5 6 \n" for k in range(3)),
        )
    )
    assert imu.gyro.tolist() == [[1.0, 2.0, 3.0]] * 3


def test_a_minus_in_a_name_turns_the_axis_round(tmp_path: Path) -> None:
    """Oracle: the header of NovAtel's RAWIMU, whose -Y columns are positive along minus y."""
    head = "tow,XAccel,-YAccel,ZAccel,XGyro,-YGyro,ZGyro\n"
    names = {
        "tow": "tow",
        "gx": "XGyro",
        "gy": "-YGyro",
        "gz": "ZGyro",
        "ax": "XAccel",
        "ay": "-YAccel",
        "az": "ZAccel",
    }
    imu = read_imu(text(tmp_path, head + "10,4,5,6,1,2,3\n11,4,5,6,1,2,3\n"), columns=names)
    assert imu.gyro[0].tolist() == [1.0, -2.0, 3.0]
    assert imu.accel[0].tolist() == [4.0, -5.0, 6.0]
    assert any("-YAccel" in check.found and "-YGyro" in check.found for check in imu.notes)


def test_a_clock_in_two_columns(tmp_path: Path) -> None:
    """Oracle: seconds and nanoseconds added by hand."""
    names = {"tow": "secs", "nsec": "nsecs"} | {
        name: name for name in ("gx", "gy", "gz", "ax", "ay", "az")
    }
    rows = "".join(f"{10 + k // 4},{250000000 * (k % 4)},1,2,3,4,5,6\n" for k in range(9))
    assert_allclose(
        read_imu(text(tmp_path, "secs,nsecs,gx,gy,gz,ax,ay,az\n" + rows), columns=names).time,
        10.0 + 0.25 * np.arange(9),
        rtol=0,
        atol=1e-9,
    )


@pytest.mark.parametrize(
    ("head", "values"), [("sd_ne sd_u", "0.03 0.05"), ("var_n var_e var_u", "0.0009 0.0009 0.0025")]
)
def test_accuracies_of_the_horizontal_and_variances(tmp_path: Path, head: str, values: str) -> None:
    """Oracle: 0.03, 0.03 and 0.05 m squared."""
    path = text(tmp_path, "".join(f"{10 + k} 46 7 500 {values}\n" for k in range(3)), "g.txt")
    cov = read_gnss(path, columns=["tow", "lat", "lon", "h", *head.split()]).cov_ned
    assert_allclose(np.diagonal(cov, axis1=1, axis2=2), [[9e-4, 9e-4, 25e-4]] * 3)
