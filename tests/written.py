"""Files that tests write and read on their own account: IMU samples, and antenna positions."""

from pathlib import Path

import numpy as np

from insgnss.records import ImuSamples


def write_imu_csv(imu: ImuSamples, path: Path) -> None:
    """Write IMU samples in SI: times with 7 decimals, rates with 9, specific forces with 8."""
    summed = imu.quantity == "increments"
    units = ("rad", "m/s") if summed else ("rad/s", "m/s^2")
    gyro, accel = ("%.12f", "%.11f") if summed else ("%.9f", "%.8f")
    names = [f"{name}[{unit}]" for name, unit in zip(("g", "a"), units, strict=True)]
    head = [name[0] + axis + name[1:] for name in names for axis in "xyz"]
    np.savetxt(
        path,
        np.column_stack([imu.time, imu.gyro, imu.accel]),
        ["%.7f", *[gyro] * 3, *[accel] * 3],
        delimiter=",",
        header=",".join(["tow[s]", *head]),
        comments="",
    )


def image_positions(path: Path) -> tuple[tuple[str, ...], np.ndarray]:
    """Images and positions (n, 3), rad and m or m, of an antenna file as `process` writes it."""
    head, *rows = (line.split() for line in path.read_text(encoding="utf-8").splitlines())
    scale = {"deg]": np.pi / 180.0, "m]": 1.0}
    position = np.array([row[1:] for row in rows], dtype=np.float64)
    return (
        tuple(row[0] for row in rows),
        position * [scale[name.partition("[")[2]] for name in head[2:]],
    )
