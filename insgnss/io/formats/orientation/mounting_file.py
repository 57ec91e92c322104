r"""The file of a calibrated mounting, `mounting.toml`: what every calibration of lever arms,
bore-sight and camera delay writes, and what `mounting.file` of a flight file reads.

Tables [mounting] and [camera] are those of a flight file and hold what the calibration
*determined*, nothing else; what it did not determine stands there as a comment with the reason.
[calibration] says where the numbers come from. data_specs/mounting_file.md has the keys.
"""

import datetime
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ....base.errors import InputError
from ....base.files import atomic_write, lines_of
from ....base.inputs import is_file
from ....base.tables import OptionTable, read_toml
from ....base.wording import toml
from ....records import Array
from ....records.cameras.mounting import (
    ANGLE_SETS,
    LONGEST_DELAY_S,
    MAX_LEVER_M,
    PAPER_CAMERA_FROM_BODY,
    Mounting,
    boresight_from_angles,
    metashape_offset,
)

VECTORS = ("antenna_m", "imu_m")
MOUNTING_VALUES = (*VECTORS, "antenna_sigma_m", "camera_from_body", "boresight", "boresight_deg")
DELAY = "time_offset_s"
MOUNTING_KEYS: Mapping[str, tuple[str, ...]] = {
    "": ("mounting", "camera", "calibration"),
    "mounting": MOUNTING_VALUES,
    "mounting.boresight_deg": ANGLE_SETS,
    "camera": (DELAY,),
    "calibration": (
        *("verb", "date", "camera", "image_size", "focal_px", "verdict"),
        *("camera_from_body", "sigma", "covariance", "not_determined", "inputs"),
    ),
    "calibration.sigma": (*VECTORS, "boresight_deg", DELAY),
    "calibration.covariance": ("antenna_m2", "imu_m2", "boresight_deg2"),
    "calibration.not_determined": (*VECTORS, "boresight", DELAY),
    "calibration.inputs": ("file", "sha256"),
}
DEG_OF_RAD = np.degrees(1.0)  # degrees of a radian
# key of sigmas and covariances, attribute with the covariance, unit of the key (of m or rad)
COVARIANCES = (
    ("antenna_m", "antenna_cov", 1.0),
    ("imu_m", "imu_cov", 1.0),
    ("boresight_deg", "boresight_cov", DEG_OF_RAD),
)


@dataclass(frozen=True, eq=False, kw_only=True)
class MountingFile:
    """A calibrated mounting with its standard errors and where it comes from.

    None says of a value that the calibration did not determine it, and that a flight file keeps its
    own.

    Parameters
    ----------
    verb : str
        What made it, such as "calibrate tripod"; empty of a file written by hand.
    antenna_m, imu_m : ndarray, (3,), or None
        Lever arms from the camera's projection centre, camera axes, m.
    boresight : ndarray, (3, 3), or None
        B_b^b'.
    camera_from_body : ndarray, (3, 3), or None
        T_b'^c that the calibration assumed; B means nothing beside another one.
    antenna_sigma_m : float or None
        Standard deviation of each component of the lever arm from the IMU to the antenna, m.
    time_offset_s : float or None
        Delay from event to mid-exposure, s.
    antenna_cov, imu_cov : ndarray, (3, 3), or None
        Covariances of the lever arms, m^2.
    boresight_cov : ndarray, (3, 3), or None
        Covariance of the bore-sight, rad^2, of a turn about the camera's x, y, z.
    time_offset_sigma_s : float or None
        Standard error of the delay, s.
    date : str
        Of the data, ISO (2018-07-06); empty: not known.
    camera : str
        Name of the camera as its images call it; empty: not known.
    image_size : tuple of int or None
        Columns and rows of its images.
    focal_px : float or None
        Its focal length, pixels.
    inputs : tuple of (str, str)
        Name and SHA-256 of each file that the calibration read.
    verdict : tuple of str
        What it says of the result, one sentence each.
    not_determined : mapping of str to str
        Reason by key (`antenna_m`, `imu_m`, `boresight`, `time_offset_s`).
    remarks : tuple of str
        Comment lines of the table [mounting], which no reader gives back.
    path : Path or None
        The file that it was read from.
    set_in_body : bool
        Whether table [mounting] itself holds `camera_from_body`, which then takes the place of the
        flight file's.

    Raises
    ------
    InputError
        A value is not what it must be.
    """

    verb: str = ""
    antenna_m: Array | None = None
    imu_m: Array | None = None
    boresight: Array | None = None
    camera_from_body: Array | None = None
    antenna_sigma_m: float | None = None
    time_offset_s: float | None = None
    antenna_cov: Array | None = None
    imu_cov: Array | None = None
    boresight_cov: Array | None = None
    time_offset_sigma_s: float | None = None
    date: str = ""
    camera: str = ""
    image_size: tuple[int, int] | None = None
    focal_px: float | None = None
    inputs: tuple[tuple[str, str], ...] = ()
    verdict: tuple[str, ...] = ()
    not_determined: Mapping[str, str] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    path: Path | None = None
    set_in_body: bool = False

    def __post_init__(self) -> None:
        stated = {key: value for key, value in self.values().items() if key != DELAY}
        mounting = Mounting(**stated)  # refuses what no vector and no rotation is
        for key in stated:
            if key != "antenna_sigma_m":
                object.__setattr__(self, key, getattr(mounting, key))
        if self.camera_from_body is not None and "camera_from_body" not in stated:
            turn = Mounting(camera_from_body=self.camera_from_body).camera_from_body
            object.__setattr__(self, "camera_from_body", turn)
        for key in VECTORS:
            value = getattr(self, key)
            if value is not None and (length := math.hypot(*value)) >= MAX_LEVER_M:
                raise InputError.of_value(
                    key,
                    f"{value.tolist()} is {length:.3g} m long (limit {MAX_LEVER_M:.0f} m);"
                    " the unit is m",
                )
        for _, key, _ in COVARIANCES:
            value = getattr(self, key)
            if value is not None and not _is_covariance(np.asarray(value)):
                raise InputError.of_value(key, "no covariance matrix of 3 rows and columns")
        if self.time_offset_s is not None and not abs(self.time_offset_s) <= LONGEST_DELAY_S:
            raise InputError.of_value(
                "time_offset_s",
                f"{self.time_offset_s:g} s (limit {LONGEST_DELAY_S:g} s); the unit is s",
            )
        if self.date:
            try:
                datetime.date.fromisoformat(self.date)
            except ValueError:
                raise InputError.of_value(
                    "date", f"{self.date!r} is no date such as 2018-07-06"
                ) from None
        twice = [key for key in self.not_determined if getattr(self, key, None) is not None]
        if twice:
            raise InputError.of_value(
                twice[0], "has a value but is also listed in not_determined; remove one"
            )

    def values(self) -> dict[str, Any]:
        """Return what the file determines, by key of the flight file's [mounting], and the delay.

        `camera_from_body` is among them only where the file sets it.
        """
        turn = ["camera_from_body"] if self.set_in_body else []
        keys = (*VECTORS, "boresight", "antenna_sigma_m", DELAY, *turn)
        return {key: getattr(self, key) for key in keys if getattr(self, key) is not None}

    def sigma(self, key: str) -> Array | None:
        """Return the standard errors of a vector or of the bore-sight.

        Parameters
        ----------
        key : str
            `antenna_m`, `imu_m` or `boresight`.

        Returns
        -------
        ndarray, (3,), or None
            m, of the bore-sight rad; None where they are not known.
        """
        cov = getattr(self, f"{key.removesuffix('_m')}_cov")
        return None if cov is None else np.sqrt(np.diag(cov))


def _is_covariance(value: NDArray[Any]) -> bool:
    """Whether `value` is symmetric with a diagonal above zero and no negative eigenvalue."""
    if value.shape != (3, 3) or not np.isfinite(value).all():
        return False
    size = float(np.abs(value).max())
    symmetric = bool(np.abs(value - value.T).max() <= 1e-6 * size)
    return symmetric and size > 0.0 and bool(np.linalg.eigvalsh(value)[0] >= -1e-6 * size)


def write_mounting_file(mounting: MountingFile, path: str | os.PathLike[str]) -> None:
    """Write a file that `read_mounting_file` turns back into the same numbers.

    Parameters
    ----------
    mounting : MountingFile
        The calibrated mounting.
    path : path-like
        The file.
    """
    atomic_write(path, mounting_text(mounting))


def mounting_text(mounting: MountingFile) -> str:
    """Return the text of the file.

    Parameters
    ----------
    mounting : MountingFile
        The calibrated mounting.

    Returns
    -------
    str
        TOML.
    """
    m = mounting
    lines = [
        f"# mounting by insgnss {m.verb}; standard errors behind the #",
        '# in a flight file: [mounting] file = "mounting.toml", or insgnss process flight.toml'
        " --mounting mounting.toml",
        "",
        "[mounting]",
    ]
    lines += [f"# {line}" for remark in m.remarks for line in lines_of(remark)]
    for key in VECTORS:
        if (value := getattr(m, key)) is not None:
            lines.append(f"{key} = {_toml(value, '.6f')}{_behind(m.sigma(key), '.4f', 'm')}")
    if m.antenna_sigma_m is not None:
        lines.append(f"antenna_sigma_m = {m.antenna_sigma_m:.4f}")
    if m.set_in_body and m.camera_from_body is not None:
        lines.append(f"camera_from_body = {_toml(m.camera_from_body, '.12g')}")
    if m.boresight is not None:
        sigma = m.sigma("boresight")
        degrees = None if sigma is None else DEG_OF_RAD * sigma
        behind = _behind(degrees, ".4f", "deg about the camera's x, y, z")
        lines.append(f"boresight = {_toml(m.boresight, '.12f')}{behind}")
    lines += _not_determined(m, without=DELAY)
    if m.time_offset_s is not None or DELAY in m.not_determined:
        lines += ["", "[camera]"]
        if m.time_offset_s is not None:
            behind = _behind(m.time_offset_sigma_s, ".6f", "s")
            lines.append(f"time_offset_s = {m.time_offset_s:.7f}{behind}")
        lines += _not_determined(m, only=DELAY)
    return "\n".join([*lines, *_provenance(m), *_of_metashape(m)]) + "\n"


def _of_metashape(m: MountingFile) -> list[str]:
    """Comments with the same mounting as Metashape takes it."""
    location, angles = metashape_offset(m.antenna_m, m.boresight, m.camera_from_body)
    lines = []
    if location is not None:
        lines.append(f"# X Y Z {_words(location, '.5f')} m, from the camera to the antenna")
    if angles is not None:
        lines.append(f"# yaw pitch roll {_words(DEG_OF_RAD * angles, '.5f')} deg")
    if not lines:
        return []
    head = [
        "# Metashape, Camera Calibration, GPS/INS Offset, for references that are positions of the",
        "# antenna and attitudes of the IMU's nominal camera (zero for exports of insgnss, which",
        "# are of the projection centre and contain the bore-sight):",
    ]
    return ["", *head, *lines]


def _not_determined(m: MountingFile, without: str = "", only: str = "") -> list[str]:
    """Comments in the place of values that the calibration does not determine."""
    return [
        f"# {key}: {' '.join(reason.split())}"
        for key, reason in m.not_determined.items()
        if key != without and only in ("", key)
    ]


def _provenance(m: MountingFile) -> list[str]:
    """Table [calibration] and those below it."""
    lines = ["", "[calibration]", f"verb = {_toml(m.verb)}"]
    if m.date:
        lines.append(f"date = {m.date}")
    if m.camera:
        lines.append(f"camera = {_toml(m.camera)}")
    if m.image_size is not None:
        lines.append(f"image_size = [{m.image_size[0]}, {m.image_size[1]}]")
    if m.focal_px is not None:
        lines.append(f"focal_px = {m.focal_px:.3f}")
    if m.boresight is not None and m.camera_from_body is not None and not m.set_in_body:
        lines.append(f"camera_from_body = {_toml(m.camera_from_body, '.12g')}")
    if m.verdict:
        lines += ["verdict = [", *(f"    {_toml(line)}," for line in m.verdict), "]"]
    sigma, cov = [], []
    for key, attribute, unit in COVARIANCES:
        if (P := getattr(m, attribute)) is not None:
            sigma.append(f"{key} = {_toml(unit * np.sqrt(np.diag(P)), '.4g')}")
            cov.append(f"{key}2 = {_toml(unit**2 * P, '.6g')}")
    if m.time_offset_sigma_s is not None:
        sigma.append(f"time_offset_s = {m.time_offset_sigma_s:.4g}")
    lines += ["", "[calibration.sigma]", *sigma] if sigma else []
    lines += ["", "[calibration.covariance]", *cov] if cov else []
    if m.not_determined:
        reasons = (f"{key} = {_toml(reason)}" for key, reason in m.not_determined.items())
        lines += ["", "[calibration.not_determined]", *reasons]
    for name, digest in m.inputs:
        lines += ["", "[[calibration.inputs]]", f"file = {_toml(name)}"]
        lines.append(f"sha256 = {_toml(digest)}")
    return lines


def _toml(value: Any, form: str = "") -> str:
    """Return a text, a number, numbers or rows of numbers as TOML, without negative zeros."""
    if isinstance(value, str):
        return toml(" ".join(value.split()))
    if np.ndim(value):
        return f"[{', '.join(_toml(item, form) for item in value)}]"
    text = format(float(value), form)
    return text[1:] if float(text) == 0.0 and text.startswith("-") else text


def _behind(sigma: Array | float | None, form: str, unit: str) -> str:
    """Return the comment with a standard error, empty where it is not known."""
    return "" if sigma is None else f"  # {_words(np.atleast_1d(sigma), form)} {unit}"


def _words(values: Array, form: str) -> str:
    return " ".join(format(float(x), form) for x in values)


def read_mounting_file(
    path: str | os.PathLike[str], camera_from_body: ArrayLike = PAPER_CAMERA_FROM_BODY
) -> tuple[MountingFile, OptionTable]:
    """Read a calibrated mounting.

    Parameters
    ----------
    path : path-like
        The file; [calibration] may be missing, and [mounting] may have any key of that of a flight
        file.
    camera_from_body : array-like, (3, 3)
        T for angles of the set metashape_ypr, where the file has none.

    Returns
    -------
    mounting : MountingFile
        What it holds.
    table : OptionTable
        The file, whose errors know their line.

    Raises
    ------
    InputError
        With file and line: the file is missing, empty or no TOML, or a key or a value is wrong.
    """
    path = Path(path)
    if not is_file(path):
        problem = "does not exist; give a mounting.toml of insgnss calibrate or insgnss adjust"
        raise InputError.in_file(path, problem)
    root = read_toml(path, MOUNTING_KEYS)
    root.check_keys()
    if not root.data:
        raise InputError.in_file(path, "is empty; a table [mounting] is expected")
    table, camera, calibration = (root.table(key) for key in ("mounting", "camera", "calibration"))
    fields = _made(calibration) | _values(table, camera_from_body)
    if DELAY in camera.data:
        fields[DELAY] = camera.number(DELAY, None, -LONGEST_DELAY_S, LONGEST_DELAY_S)
    where = {DELAY: camera, "date": calibration}
    try:
        return MountingFile(path=path, **fields), root
    except InputError as refusal:
        raise where.get(refusal.key, table).error(refusal.key, refusal.problem) from None


def _values(table: OptionTable, camera_from_body: ArrayLike) -> dict[str, Any]:
    """What table [mounting] holds."""
    fields: dict[str, Any] = {key: table.numbers(key, 3) for key in VECTORS if key in table.data}
    if "antenna_sigma_m" in table.data:
        fields["antenna_sigma_m"] = table.number("antenna_sigma_m", None, 0.0, 10.0)
    for key in ("camera_from_body", "boresight"):
        if key in table.data:
            fields[key] = table.matrix(key)
    fields["set_in_body"] = "camera_from_body" in fields
    if "boresight_deg" not in table.data:
        return fields
    if "boresight" in fields:
        raise table.error("boresight_deg", "boresight is given as well; keep one of them")
    named = table.table("boresight_deg")
    if len(named.data) != 1:
        choices = ", ".join(ANGLE_SETS)
        problem = f"name one angle set, such as {{ opk = [..] }}; known are {choices}"
        raise table.error("boresight_deg", problem)
    (angle_set,) = named.data
    turn = fields.get("camera_from_body", camera_from_body)
    fields["boresight"] = boresight_from_angles(angle_set, named.numbers(angle_set, 3), turn)
    return fields


def _made(table: OptionTable) -> dict[str, Any]:
    """What table [calibration] holds."""
    fields: dict[str, Any] = {
        key: table.text(key) for key in ("verb", "camera") if key in table.data
    }
    if (date := table.data.get("date")) is not None:
        fields["date"] = date if isinstance(date, str) else str(date)
    if "image_size" in table.data:
        columns, rows = table.numbers("image_size", 2)
        fields["image_size"] = (int(columns), int(rows))
    if "focal_px" in table.data:
        fields["focal_px"] = table.number("focal_px", None, 1.0)
    if "camera_from_body" in table.data:
        fields["camera_from_body"] = table.matrix("camera_from_body")
    fields["verdict"] = table.texts("verdict", ())
    reasons = table.table("not_determined")
    fields["not_determined"] = {key: reasons.text(key) for key in reasons.data}
    fields["inputs"] = tuple(
        (item.text("file"), item.text("sha256")) for item in table.tables("inputs")
    )
    sigma, cov = table.table("sigma"), table.table("covariance")
    for key, name, unit in COVARIANCES:
        if f"{key}2" in cov.data:
            fields[name] = cov.matrix(f"{key}2") / unit**2
            if not _is_covariance(fields[name]):
                raise cov.error(f"{key}2", "is no covariance matrix")
        elif key in sigma.data:
            fields[name] = np.diag(np.square(sigma.sigmas(key, None))) / unit**2
    if DELAY in sigma.data:
        fields["time_offset_sigma_s"] = sigma.number(DELAY, None, 0.0)
    return fields
