"""The deterministic calibration of an IMU: its model, its file and its application.

A triad whose axes are neither of unit sensitivity nor orthogonal reads, of a vector v in the IMU's
orthogonal axes,

    raw = E v + bias,   E = I + diag(s) + N                                                    (C.1)
    v = M (raw - bias), M = E^-1                                                               (C.2)

s are the scale-factor errors (1000 ppm: the sensor reads 0.1 % too much), N has the misalignments
off the diagonal: N_yx is the part of x that the y sensor feels, rad. The orthogonal axes are those
of the accelerometers: x along the x accelerometer, y in the plane of the x and y accelerometers, so
the N of the accelerometers is lower triangular (N_yx, N_zx, N_zy); that of the gyroscopes has all
six (N_xy, N_xz, N_yx, N_yz, N_zx, N_zy). A file that gives three means a lower triangle, for either
triad. All of it is in the sensor's own axes, before `imu.axes` turns them into the body's.

The file is TOML, `data_specs/imu_calibration.md`.
"""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from ...base.errors import InputError
from ...base.files import atomic_write
from ...base.tables import OptionTable, read_toml
from ...base.units import format_quantity, parse_quantity
from ...base.wording import toml
from ...records import Array, ImuSamples, Question
from .gaps import sample_lengths

OFF_IDENTITY = 0.1  # of the matrix from identity: no calibration, but other units or axes
LOWER = ((1, 0), (2, 0), (2, 1))  # cells of N for three misalignments: N_yx, N_zx, N_zy
OFF_DIAGONAL = ((0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1))  # cells of N for six
BIAS_UNIT = {"gyro": "deg/s", "accel": "m/s^2"}
BIAS_LIMIT = {"gyro": np.radians(20.0), "accel": 5.0}
_VALUES = ("bias", "scale_factor", "misalignment")
CALIBRATION_KEYS: Mapping[str, tuple[str, ...]] = {
    "": ("name", "source", "gyro", "accel"),
    **{
        sensor: (*_VALUES, "matrix", *(f"{name}_sigma" for name in _VALUES))
        for sensor in ("gyro", "accel")
    },
}


@dataclass(frozen=True, eq=False)
class TriadCalibration:
    """Calibration of three gyroscopes or three accelerometers (C.1), in the sensor's own axes.

    Parameters
    ----------
    bias : ndarray, shape (3,), rad/s or m/s^2
    response : ndarray, shape (3, 3)
        E of (C.1).
    bias_sigma : ndarray, shape (3,), rad/s or m/s^2, optional
        Standard errors of the bias; None where they are not known.
    response_sigma : ndarray, shape (3, 3), optional
        Standard errors of the response; None where they are not known.
    """

    bias: Array = field(default_factory=lambda: np.zeros(3))
    response: Array = field(default_factory=lambda: np.eye(3))
    bias_sigma: Array | None = None
    response_sigma: Array | None = None

    @property
    def matrix(self) -> Array:
        """The correction matrix M of (C.2), shape (3, 3)."""
        return np.asarray(np.linalg.inv(self.response), dtype=np.float64)

    @property
    def scale_factor(self) -> Array:
        """The scale-factor errors s of (C.1), shape (3,)."""
        return np.diag(self.response) - 1.0

    def correct(self, reading: Array, dt: Array | float = 1.0) -> Array:
        """Apply the calibration to readings (C.2).

        Parameters
        ----------
        reading : ndarray, shape (n, 3)
            Rates (rad/s or m/s^2) or increments (rad or m/s).
        dt : ndarray of shape (n, 1), or float, s
            The interval of each increment; 1 where the readings are rates.

        Returns
        -------
        ndarray, shape (n, 3)
            The calibrated readings in the same quantity.
        """
        return np.ascontiguousarray((reading - self.bias * dt) @ self.matrix.T)


@dataclass(frozen=True, eq=False)
class ImuCalibration:
    """Calibration of both triads of an IMU."""

    gyro: TriadCalibration = field(default_factory=TriadCalibration)
    accel: TriadCalibration = field(default_factory=TriadCalibration)
    name: str = ""
    source: str = ""

    def __post_init__(self) -> None:
        for sensor, triad in self.triads.items():
            key, problem = _implausible(sensor, triad)
            if problem:
                raise InputError(f"calibration {self.name!r}: {sensor} {key}: {problem}")

    @property
    def triads(self) -> dict[str, TriadCalibration]:
        """Both triads by the names of their tables."""
        return {"gyro": self.gyro, "accel": self.accel}

    def apply(self, imu: ImuSamples) -> ImuSamples:
        """Return calibrated samples in the same quantity (C.2), with a note of what was applied."""
        dt = sample_lengths(imu.time)[:, None] if imu.quantity == "increments" else 1.0
        note = Question("IMU calibration", "").ok(
            f"{self.name or 'calibration'} applied: {self.summary()}"
        )
        return replace(
            imu,
            gyro=self.gyro.correct(imu.gyro, dt),
            accel=self.accel.correct(imu.accel, dt),
            notes=(*imu.notes, note),
        )

    def summary(self) -> str:
        """Name the largest bias, scale-factor error and misalignment of both triads."""
        parts = []
        for sensor, triad in self.triads.items():
            beside = triad.response - np.diag(np.diag(triad.response))
            bias = np.abs(triad.bias).max()
            text = f"{np.degrees(bias):.3f} deg/s" if sensor == "gyro" else f"{bias:.3f} m/s^2"
            ppm, mrad = 1e6 * np.abs(triad.scale_factor).max(), 1e3 * np.abs(beside).max()
            scale = f"scale to {ppm:.0f} ppm, misalignment to {mrad:.2f} mrad"
            parts.append(f"{sensor} bias to {text}, {scale}")
        return "; ".join(parts)


def _implausible(sensor: str, triad: TriadCalibration) -> tuple[str, str]:
    """Key and words of what is wrong with a calibration; two empty texts where nothing is."""
    if triad.bias.shape != (3,) or triad.response.shape != (3, 3):
        return "bias", (
            f"shapes {triad.bias.shape} and {triad.response.shape} of bias and response,"
            " expected (3,) and (3, 3)"
        )
    if not (np.isfinite(triad.bias).all() and np.isfinite(triad.response).all()):
        return "bias", "a value is not finite"
    if np.abs(triad.bias).max() > BIAS_LIMIT[sensor]:
        limit = f"{BIAS_LIMIT[sensor]:.3g} {'rad/s' if sensor == 'gyro' else 'm/s^2'}"
        return "bias", f"{np.abs(triad.bias).max():.3g} is beyond {limit}; check the unit"
    return "matrix", _off_identity(triad.response)


def _off_identity(matrix: Array) -> str:
    """What is wrong with a matrix that is no calibration; empty where nothing is."""
    far = float(np.abs(matrix - np.eye(3)).max())
    if far <= OFF_IDENTITY:
        return ""
    return (
        f"differs from identity by {100 * far:.0f} % (limit {100 * OFF_IDENTITY:.0f} %); state "
        "axes and units in the flight file instead"
    )


def load_calibration(path: str | os.PathLike[str]) -> ImuCalibration:
    """Read a calibration file.

    Parameters
    ----------
    path : str or os.PathLike
        A TOML file (`data_specs/imu_calibration.md`).

    Returns
    -------
    ImuCalibration

    Raises
    ------
    InputError
        With file and line, for a file that is missing or no TOML, an unknown key, a value without
        unit or of another dimension, `matrix` beside what it replaces, and values that no IMU has.
    """
    top = read_toml(Path(path), CALIBRATION_KEYS)
    top.check_keys()
    triads = {}
    for sensor in ("gyro", "accel"):
        table = top.table(sensor)
        triads[sensor] = _triad(table, sensor)
        key, problem = _implausible(sensor, triads[sensor])
        if problem:
            keys = (key, "scale_factor", "misalignment")
            raise table.error(next((k for k in keys if k in table.data), key), problem)
    name, source = top.text("name", Path(path).stem), top.text("source", "not stated")
    return ImuCalibration(triads["gyro"], triads["accel"], name, source)


def _triad(table: OptionTable, sensor: str) -> TriadCalibration:
    bias = _quantities(table, "bias", BIAS_UNIT[sensor], (3,))
    scale = _quantities(table, "scale_factor", "ppm", (3,))
    off_diagonal = _quantities(table, "misalignment", "mrad", (3, 6))
    sigma = [
        _quantities(table, f"{key}_sigma", unit, (3,))
        for key, unit in (("bias", BIAS_UNIT[sensor]), ("scale_factor", "ppm"))
    ]
    off_sigma = _quantities(table, "misalignment_sigma", "mrad", (3, 6))
    if "matrix" in table.data:
        if beside := [key for key in ("scale_factor", "misalignment") if key in table.data]:
            raise table.error(
                "matrix", f"is given with {' and '.join(beside)}, which it replaces; keep one"
            )
        matrix = table.matrix("matrix")
        if fault := _off_identity(matrix):
            raise table.error("matrix", fault)
        response = np.asarray(np.linalg.inv(matrix), dtype=np.float64)
    else:
        response = np.eye(3) + _assemble_matrix(scale, off_diagonal)
    response_sigma = (
        None if sigma[1] is None and off_sigma is None else _assemble_matrix(sigma[1], off_sigma)
    )
    return TriadCalibration(
        np.zeros(3) if bias is None else bias, response, sigma[0], response_sigma
    )


def _quantities(table: OptionTable, key: str, unit: str, sizes: tuple[int, ...]) -> Array | None:
    """Quantities of `key` in SI, None where it is absent."""
    values = table.value(key, list, None)
    if values is None:
        return None
    if len(values) not in sizes:
        raise table.error(
            key,
            f"{len(values)} values, expected {' or '.join(map(str, sizes))}, such as '0.1 {unit}'",
        )
    try:
        return np.array([parse_quantity(value, unit) for value in values])
    except InputError as error:
        raise table.error(key, str(error)) from None


def _assemble_matrix(diagonal: Array | None, off_diagonal: Array | None) -> Array:
    """Assemble a (3, 3) matrix of its diagonal and the three or six values beside it."""
    out = np.diag(np.zeros(3) if diagonal is None else diagonal)
    if off_diagonal is not None:
        for cell, value in zip(
            LOWER if off_diagonal.size == 3 else OFF_DIAGONAL, off_diagonal, strict=True
        ):
            out[cell] = value
    return out


def write_calibration(
    calibration: ImuCalibration, path: str | os.PathLike[str], remarks: tuple[str, ...] = ()
) -> None:
    """Write a file that `load_calibration` turns back into the same numbers.

    Parameters
    ----------
    calibration : ImuCalibration
    path : str or os.PathLike
    remarks : tuple of str
        Comments at the top of the file.
    """
    lines = [f"# {remark}" for remark in remarks]
    lines += [
        f"{key} = {toml(getattr(calibration, key))}"
        for key in ("name", "source")
        if getattr(calibration, key)
    ]
    for sensor, triad in calibration.triads.items():
        lines += ["", f"[{sensor}]"]
        lines.append(_line("bias", triad.bias, BIAS_UNIT[sensor]))
        lines += _response_lines(triad.response - np.eye(3), "")
        if triad.bias_sigma is not None:
            lines.append(_line("bias_sigma", triad.bias_sigma, BIAS_UNIT[sensor]))
        if triad.response_sigma is not None:
            lines += _response_lines(triad.response_sigma, "_sigma")
    atomic_write(path, "\n".join(lines) + "\n")


def _response_lines(values: Array, suffix: str) -> list[str]:
    above = any(values[cell] for cell in OFF_DIAGONAL if cell not in LOWER)
    cells = OFF_DIAGONAL if above else LOWER
    values_off = np.array([values[cell] for cell in cells])
    return [
        _line(f"scale_factor{suffix}", np.diag(values), "ppm"),
        _line(f"misalignment{suffix}", values_off, "mrad"),
    ]


def _line(key: str, values: Array, unit: str) -> str:
    return f"{key} = {toml([format_quantity(float(v), unit) for v in values])}"
