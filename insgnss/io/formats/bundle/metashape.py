r"""Metashape's reference csv for cameras in its three variants, data_specs/metashape.md.

Import with columns "nxyzabcXYZABC", delimiter ",", skip_rows 1 and the CRS that the header names. x
is easting or longitude. `returned.tables.read_metashape_reference` reads those of the
globe with their bore-sight back.

`write_metashape` gives yaw, pitch, roll of the camera with axes right, up, back in east, north, up
*at the camera*: true north, also in a projected CRS; in a tangent plane (LOCAL_CS) the axes of the
plane (data_specs/metashape.md):

    R = C_Ec CV_RUB = Rz(-yaw) Rx(pitch) Ry(roll)                                              (M.1)

`write_metashape_opk` gives omega, phi, kappa in the axes of the CRS, C_fc CV_RUB = Rx(omega)
Ry(phi) Rz(kappa). Both have lever arm and bore-sight applied, so that a GPS/INS offset must stay
off.

`write_metashape_offset` leaves the bore-sight B to Metashape, which multiplies a GPS/INS offset
rotation to the camera's. With T the nominal mounting (`camera_from_body`) and G = CV_RUB T, body to
camera right-up-back, the angles are those of the nominal camera and

    C_Ec(nominal) = C_Ec T B T^T,        ypr2mat(offset) = G B G^T                             (M.2)

The offset stands in a text beside the csv. The format takes no
correlations.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from ....base.files import atomic_write
from ....base.output.staging import together
from ....records import Array, FramedOrientation
from ....records.cameras.mounting import metashape_offset
from ....records.framed import GEOGRAPHIC
from ..orientation.ascii_columns import write_columns
from ..orientation.exported import comment_lines, frame_words, one_line
from ..text.text import Source


def write_metashape(eo: FramedOrientation, path: Source) -> None:
    """Write yaw, pitch, roll (M.1) in a geographic, projected or tangent-plane frame.

    Degrees have 10 decimals (position) and 6 (angles), metres 4, accuracies 5 and 6.

    Parameters
    ----------
    eo : FramedOrientation
        The orientation in its frame.
    path : path
        The file.

    Raises
    ------
    InputError
        Names with commas.
    DataError
        Pitch is +-90 deg.
    """
    _write(eo, path, "ypr", ("Yaw", "Pitch", "Roll"))


def write_metashape_opk(eo: FramedOrientation, path: Source) -> None:
    """Write omega, phi, kappa in the axes of the CRS; digits and refusals as `write_metashape`."""
    _write(eo, path, "opk", ("Omega", "Phi", "Kappa"))


def write_metashape_offset(eo: FramedOrientation, path: Source) -> None:
    """Write yaw, pitch, roll of the nominal camera, and the GPS/INS offset beside it (M.2).

    The offset stands in <name>_gps_ins_offset.txt, of a rig one for each camera.
    """
    nominal = replace(eo, C_fc=eo.C_fc @ _boresights(eo))
    path = Path(path)
    with together():
        _write(nominal, path, "ypr", ("Nominal_yaw", "Nominal_pitch", "Nominal_roll"))
        atomic_write(path.with_name(f"{path.stem}_gps_ins_offset.txt"), _offset_text(eo))


def _offset_text(eo: FramedOrientation) -> str:
    offsets = []
    for name, boresight, T in _mountings(eo):
        _, offset = metashape_offset(None, boresight, T)
        assert offset is not None
        yaw, pitch, roll = np.degrees(offset)
        offsets.append(
            f"{f'{name}: ' if name else ''}X, Y, Z (m): 0, 0, 0\n"
            f"Yaw, Pitch, Roll (deg): {yaw:.6f}, {pitch:.6f}, {roll:.6f}\n"
        )
    lines = (
        (
            "GPS/INS offset of Metashape: Tools, Camera Calibration, GPS/INS Offset; fix or adjust"
            " it there"
        ),
        (
            "use this offset only with the csv beside this file, which holds the angles of the"
            " nominal camera: without the offset the bore-sight is missing, with another export it"
            " counts twice"
        ),
        "the positions are those of the projection centre: the location stays 0",
    )
    comments = comment_lines(
        eo, *lines, applied="lever arm applied, bore-sight not applied in the angles of the csv"
    )
    return comments + "".join(offsets)


def _mountings(eo: FramedOrientation) -> list[tuple[str, Array, Array]]:
    """Name, bore-sight and nominal turn of each camera; a single one has no name."""
    if eo.rig is None:
        return [("", eo.boresight, eo.camera_from_body)]
    return [(camera.name, camera.boresight, camera.camera_from_body) for camera in eo.rig.cameras]


def _boresights(eo: FramedOrientation) -> Array:
    """T B T^T (M.2), (n, 3, 3) of a rig."""
    each = [T @ boresight @ T.T for _, boresight, T in _mountings(eo)]
    return each[0] if eo.rig is None else np.asarray(np.stack(each)[eo.rig.number])


def _write(eo: FramedOrientation, path: Source, angles: str, names: tuple[str, ...]) -> None:
    """Write a reference with a group of angles, whose columns have these names."""
    position = ("X", "Y", "Z")
    if eo.frame.kind != GEOGRAPHIC:
        position = (f"Easting ({one_line(frame_words(eo))})", "Northing", "Height")
    columns = ("#Label", *position, *names, *(f"{name}_acc" for name in ("X", "Y", "Z", *names)))
    header = ",".join(columns) + "\n"
    write_columns(eo, path, f"image xyz {angles} s_xyz s_{angles}", ",", header)
