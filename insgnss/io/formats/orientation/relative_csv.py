"""relative.csv: relative pose of neighbouring images, data_specs/relative_csv.md.

One row a pair: its value, the standard deviations of the three weightings side by side, and the
full covariance of the third, P = cov(offset, psi) with rotation(true) = exp([psi x]) rotation,
upper triangle row by row. Of the other two the standard deviations are all: paper 003 gives no
correlations.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....base import __version__
from ....geodesy.rotation import quaternion_from_rotation, rotation_from_quaternion
from ....records.relative import RELATIVE_FORMS, RelativeControl
from ..text.columns import TableOut, TableSpec
from ..text.numbers import whole_rows
from ..text.order import refuse_rows
from ..text.text import Source
from .exported import quoted_names

Array = NDArray[np.float64]

WEIGHTINGS = ("smoothed", "independent", "gyro")
POSE_AXES = ("x", "y", "z", "rx", "ry", "rz")
RELATIVE_OFFSET, QUATERNION = "dx dy dz", "qw qx qy qz"
RELATIVE_SIGMAS = " ".join(f"sd_{axis}_{name}" for name in WEIGHTINGS for axis in POSE_AXES)
COVARIANCE = " ".join(f"cov_{a}_{b}" for k, a in enumerate(POSE_AXES) for b in POSE_AXES[k:])
OUT = TableOut(
    "image_i image_j form line=%d dt_s=%.6f dx=%.5f dy=%.5f dz=%.5f qw=%.12f qx=%.12f qy=%.12f"
    " qz=%.12f "
    + " ".join(
        f"{name}=%.{8 if name.startswith('sd_r') else 6}f" for name in RELATIVE_SIGMAS.split()
    )
    + f" {COVARIANCE.replace(' ', '=%.9e ')}=%.9e"
)
SPEC = TableSpec.exactly(OUT.names, text=True)
UNIT_LENGTH = 1e-6  # length of a printed quaternion less 1: rounding of twelve digits
# m stay m, rad become deg, of offset and rotation
_DEGREES = np.array([1.0] * 3 + [180.0 / np.pi] * 3)
_IN_WORDS = {
    "mapping": (
        "offset X_j - X_i and rotation C(j) C(i)^T, C camera to the frame's axes; both in the"
        " frame's axes; free of the bore-sight"
    ),
    "camera": (
        "offset C(i)^T (X_j - X_i) and rotation C(i)^T C(j): the pose of camera j in the axes of"
        " camera i (x right, y down, z view)"
    ),
}


@dataclass(frozen=True, eq=False)
class RelativeTable:
    """The content of the file, of k pairs: as `records.relative.RelativeControl`.

    `sigma` is (k, 6), m and rad, of each of `WEIGHTINGS`.
    """

    form: str
    names: tuple[tuple[str, str], ...]
    line: NDArray[np.int64]
    dt: Array
    offset: Array
    rotation: Array
    sigma: dict[str, Array]
    smoothed: Array


def write_relative_csv(control: RelativeControl, path: Source) -> None:
    """Write relative control.

    Metres have 5 decimals, quaternions 12, standard deviations 6 (m) and 8 (deg), covariances 10
    digits.
    """
    quoted = dict(zip(control.images, quoted_names(control.images, ","), strict=True))
    sigmas = [
        np.sqrt(np.diagonal(getattr(control, name), axis1=1, axis2=2)) * _DEGREES
        for name in WEIGHTINGS
    ]
    row, column = np.triu_indices(6)
    q = quaternion_from_rotation(control.rotation)
    table = np.hstack(
        [
            control.line[:, None],
            control.dt[:, None],
            control.offset,
            q,
            *sigmas,
            control.smoothed[:, row, column],
        ]
    )
    images = ([quoted[names[k]] for names in control.names] for k in (0, 1))
    OUT.write(path, table, *images, [control.form] * len(table), comments=comments(control))


def comments(control: RelativeControl) -> list[str]:
    """Return the comment lines: form, frame, weightings, what was applied."""
    noise, drift = np.degrees(control.gyro_noise), np.degrees(control.gyro_drift)
    return [
        (
            f"insgnss {__version__}: relative control of {control.i.size} pairs of neighbouring"
            f" images, GPS week {control.gps_week}"
        ),
        f"frame: {control.frame}",
        f"form {control.form}: {_IN_WORDS[control.form]}",
        (
            "units: dx dy dz and sd_x to sd_z m; sd_rx to sd_rz deg; cov_* m and rad; quaternion w"
            " x y z (Hamilton) of the rotation"
        ),
        (
            "error: truth minus estimate; rotation(true) = exp([r x]) rotation; projection centres,"
            " lever arm and bore-sight applied"
        ),
        (
            "smoothed: with the cross-covariance of both images, cov_* in full; the other two are"
            " standard deviations without correlations:"
        ),
        "independent: both images as if independent (paper 003, equation 5)",
        (
            f"gyro: attitude of white noise {noise:.6g} deg/sqrt(s) and drift {drift:.6g} deg/s,"
            " 1.5 times about the vertical (equation 6)"
        ),
        "boresight: " + " ".join(f"{x:.9f}" for x in control.boresight.ravel()),
        *(f"done: {' '.join(sentence.split())}" for sentence in control.history),
    ]


def relative_member(control: RelativeControl) -> dict[str, Any]:
    """Return the same as the member `relative` of eo.json: form, conventions and one object a pair.

    Its numbers read back bit by bit.
    """
    q = quaternion_from_rotation(control.rotation)
    sigma = {
        name: np.sqrt(np.diagonal(getattr(control, name), axis1=1, axis2=2))
        for name in WEIGHTINGS[1:]
    }
    pairs = [
        {
            "i": names[0],
            "j": names[1],
            "line": int(control.line[k]),
            "dt_s": float(control.dt[k]),
            "offset_m": control.offset[k].tolist(),
            "quaternion_wxyz": q[k].tolist(),
            "cov6": control.smoothed[k].tolist(),
            "sigma6_independent": sigma["independent"][k].tolist(),
            "sigma6_gyro": sigma["gyro"][k].tolist(),
        }
        for k, names in enumerate(control.names)
    ]
    error = (
        "cov6 and sigma6: of (offset, psi), m and rad, truth minus estimate; rotation(true) ="
        " exp([psi x]) rotation"
    )
    figures = {
        "white_noise_rad_per_sqrt_s": control.gyro_noise,
        "drift_rad_per_s": control.gyro_drift,
    }
    return {
        "form": control.form,
        "conventions": f"{_IN_WORDS[control.form]}; {error}",
        "gyro": figures,
        "pairs": pairs,
    }


def read_relative_csv(path: Source) -> RelativeTable:
    """Read the file back.

    Raises
    ------
    InputError
        A form that is unknown or changes, or a quaternion without length 1, with file and line.
    """
    table = SPEC.read(path)
    forms = table.strings("form")
    for row, form in enumerate(forms):
        if form not in RELATIVE_FORMS or form != forms[0]:
            raise table.error_at(
                row, f"form {form!r}; it is {' or '.join(RELATIVE_FORMS)}, the same in all rows"
            )
    q = table.block(QUATERNION)
    length = np.linalg.norm(q, axis=1)
    message = "the quaternion has the length {:.7f}; it must be 1"
    refuse_rows(table, np.abs(length - 1.0) > UNIT_LENGTH, message, length)
    P = np.zeros((len(forms), 6, 6))
    row_of, column_of = np.triu_indices(6)
    P[:, row_of, column_of] = P[:, column_of, row_of] = table.block(COVARIANCE)
    sigma = table.block(RELATIVE_SIGMAS).reshape(-1, 3, 6) / _DEGREES
    return RelativeTable(
        forms[0],
        tuple(zip(table.strings("image_i"), table.strings("image_j"), strict=True)),
        whole_rows(table, table.floats("line"), "line"),
        table.floats("dt_s"),
        table.block(RELATIVE_OFFSET),
        rotation_from_quaternion(q / length[:, None]),
        {name: sigma[:, k] for k, name in enumerate(WEIGHTINGS)},
        P,
    )
