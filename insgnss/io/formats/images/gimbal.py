r"""Yaw, pitch and roll of a DJI gimbal, as their readers take them.

A DJI gimbal that looks into the nadir is at the singularity of its own angles: exact ones are large
and nearly opposite there, and many readers take the yaw alone for the heading. So `gimbal` "nadir"
writes the yaw of the image's top, -90 and 0 and leaves the tilt to `Camera:`; "exact" writes the
angles of the definition, with (x view, y right, z down) of the camera in north, east, down

    C_nE C_Ec [[0,1,0],[0,0,1],[1,0,0]] = Rz(yaw) Ry(pitch) Rx(roll)                           (I.1)

OpenDroneMap takes a gimbal's pitch before that of `Camera:`, and counts it from the horizon only
where the image says that DJI or Hasselblad made its camera, from the nadir elsewhere. So "auto"
writes angles of a gimbal for those alone: a camera of others would be turned by 90 degrees by them,
and one of DJI without them. It takes Rz(yaw) Ry(pitch + 90 deg) Rx(roll) for the attitude of
(image's top, right, view), so that the roll of (I.1) turns its images by

    2 acos(cos^2(roll / 2))                                                                    (I.2)

"auto" therefore decides image by image, see `_is_nadir`.
"""

import numpy as np

from ....base.errors import DataError
from ....geodesy.rotation import NED_ENU
from ....records import Array, FramedOrientation
from ..orientation.ascii_columns import GIMBAL_CV

EXACT_ANGLES = "exact: north east down, Z-Y-X, camera forward at zero"
NADIR_ANGLES = (
    "nadir: yaw of the image's top, the tilt is left out; Camera:Yaw, Pitch, Roll are exact"
)
# off the nadir (deg): a camera tilted farther looks nearer to the horizon than down
MOST_TILT_DEG = 45.0
# off the nadir (deg): a camera tilted less is meant to look down; a gimbal holds it to 1 deg, a
# drone with a fixed camera tilts by as much in calm air
NADIR_DEG = 5.0
# horizontal part of a unit viewing direction below which its azimuth is round-off: the azimuth
# errs by 1e-16 over this part (rad)
LOCKED = 1e-9
ANGLES_LEFT_OUT = "left out"
GIMBALS = ("auto", "none", "nadir", "exact")


def gimbal_angles(eo: FramedOrientation, yaw: Array, gimbal: str) -> tuple[Array | None, list[str]]:
    """Return yaw, pitch, roll (n, 3), deg, of DJI, and what they mean, image by image.

    Parameters
    ----------
    eo : FramedOrientation
        The orientation.
    yaw : ndarray, (n,)
        Azimuths of the images' tops, rad.
    gimbal : {"auto", "none", "nadir", "exact"}
        Which of them.

    Returns
    -------
    tuple
        The angles, None where there are none; one sentence an image.

    Raises
    ------
    DataError
        A camera that looks more than 45 deg off the nadir with gimbal "nadir".
    """
    if gimbal == "none":
        return None, [ANGLES_LEFT_OUT] * len(yaw)
    tilt = np.degrees(np.arccos(np.clip(-eo.C_Ec[:, 2, 2], -1.0, 1.0)))
    if gimbal == "nadir" and (oblique := tilt > MOST_TILT_DEG).any():
        image = int(np.argmax(oblique))
        message = (
            f"looks {tilt[image]:.1f} deg off the nadir (limit {MOST_TILT_DEG:.0f} deg for gimbal"
            " 'nadir')"
        )
        raise DataError(
            f"image {eo.images[image]}: {message}; take gimbal 'auto', 'exact' or 'none'"
        )
    exact = _exact_angles(eo, yaw)
    down = np.column_stack(
        [(np.degrees(yaw) + 180.0) % 360.0 - 180.0, np.full_like(yaw, -90.0), np.zeros_like(yaw)]
    )
    nadir = np.full(len(yaw), gimbal == "nadir")
    if gimbal == "auto":
        nadir = _is_nadir(tilt, exact[:, 2])
    angles_deg = np.where(nadir[:, None], down, exact)
    return angles_deg, [NADIR_ANGLES if looks_down else EXACT_ANGLES for looks_down in nadir]


def _is_nadir(tilt: Array, roll: Array) -> Array:
    """Return whether -90 and roll 0 are what readers take rightly, (n,).

    They are near the nadir, and for a tilted camera where the tilt (n,), deg, that they leave out
    is less than what the exact roll (n,), deg, costs a reader (I.2).
    """
    cost = np.degrees(2.0 * np.arccos(np.cos(np.radians(roll) / 2.0) ** 2))
    return (tilt <= NADIR_DEG) | ((tilt <= MOST_TILT_DEG) & (tilt <= cost))


def _exact_angles(eo: FramedOrientation, yaw: Array) -> Array:
    """Return yaw, pitch, roll (n, 3), deg, of (I.1).

    Where the camera looks straight down its azimuth is that of the image's top, `yaw` (n,), rad.
    The roll is what this azimuth leaves, so that all three give the attitude back in any case.
    """
    C_ned = NED_ENU @ eo.C_Ec @ GIMBAL_CV
    horizontal = np.hypot(C_ned[:, 0, 0], C_ned[:, 1, 0])
    azimuth = np.where(horizontal > LOCKED, np.arctan2(C_ned[:, 1, 0], C_ned[:, 0, 0]), yaw)
    sine, cosine = np.sin(azimuth)[:, None], np.cos(azimuth)[:, None]
    right_axis = cosine * C_ned[:, 1] - sine * C_ned[:, 0]
    roll = np.arctan2(-right_axis[:, 2], right_axis[:, 1])
    azimuth = (azimuth + np.pi) % (2.0 * np.pi) - np.pi
    return np.degrees(np.column_stack([azimuth, np.arctan2(-C_ned[:, 2, 0], horizontal), roll]))
