"""A calibrated camera in COLMAP's notation: `MODEL WIDTH HEIGHT PARAMETERS`.

Pixels count from the outer corner of the first one.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ....base.errors import UsageError
from ....records.block import INTERIOR, BrownCamera
from ..text.numbers import finite, whole

_OPENCV = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2")
BROWN_NAMES = {
    "SIMPLE_PINHOLE": ("f", "cx", "cy"),
    "PINHOLE": ("fx", "fy", "cx", "cy"),
    "SIMPLE_RADIAL": ("f", "cx", "cy", "k"),
    "RADIAL": ("f", "cx", "cy", "k1", "k2"),
    "OPENCV": _OPENCV,
    "FULL_OPENCV": (*_OPENCV, "k3", "k4", "k5", "k6"),
}
"""Parameters of the models that are Brown's, or a part of it; p2 belongs to r^2 + 2 x^2."""
FISHEYE_NAMES = {
    "SIMPLE_RADIAL_FISHEYE": ("f", "cx", "cy", "k"),
    "RADIAL_FISHEYE": ("f", "cx", "cy", "k1", "k2"),
    "OPENCV_FISHEYE": ("fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"),
    "THIN_PRISM_FISHEYE": (*_OPENCV, "k3", "k4", "sx1", "sy1"),
}
"""The same of fisheye models, whose polynomial takes equidistant points."""
PARAMETER_NAMES = BROWN_NAMES | FISHEYE_NAMES | {"FOV": ("fx", "fy", "cx", "cy", "omega")}
GIVE_CAMERA = (
    "give MODEL WIDTH HEIGHT PARAMETERS as in COLMAP's cameras.txt, such as --set camera='PINHOLE"
    " 5120 3840 5607 5607 2560 1920' (fx fy cx cy)"
)


@dataclass(frozen=True)
class ColmapCamera:
    """Model, size in pixels, and parameters in the model's order.

    The parameters are focal lengths, principal point and distortion.
    """

    model: str
    width: int
    height: int
    parameters: tuple[float, ...]

    @property
    def line(self) -> str:
        """The camera as cameras.txt has it."""
        return " ".join(
            [self.model, str(self.width), str(self.height), *(f"{p:.10g}" for p in self.parameters)]
        )

    @property
    def values(self) -> dict[str, float]:
        """Parameters by their names."""
        return dict(zip(PARAMETER_NAMES.get(self.model, ()), self.parameters, strict=False))

    @property
    def focal(self) -> tuple[float, float]:
        """Focal lengths along x and y, pixels."""
        values = self.values
        return values.get("fx", values.get("f", 0.0)), values.get("fy", values.get("f", 0.0))

    @property
    def principal_point(self) -> tuple[float, float]:
        """Principal point from the image's upper left corner, pixels."""
        return self.values["cx"], self.values["cy"]


def brown_camera(
    name: str, width: float, height: float, values: Mapping[str, float], fisheye: bool = False
) -> BrownCamera:
    """Return a camera by the names of `INTERIOR`; parameters without value are zero."""
    interior = np.array([values.get(key, 0.0) for key in INTERIOR])
    return BrownCamera(name, int(width), int(height), interior, fisheye=fisheye)


def of_opencv(values: Mapping[str, float]) -> dict[str, float]:
    """Return parameters of OpenCV by the names of `INTERIOR`: its p1 and p2 are exchanged."""
    f = values.get("f", values.get("fy", 0.0))
    focal = {"f": f, "b1": values.get("fx", f) - f, "k1": values.get("k1", values.get("k", 0.0))}
    return {**values, **focal, "p1": values.get("p2", 0.0), "p2": values.get("p1", 0.0)}


def cameras_of(text: str | None, names: Sequence[str], who: str) -> tuple[ColmapCamera, ...]:
    """Parse the cameras of a rig.

    Parameters
    ----------
    text : str, optional
        "NAME=MODEL WIDTH HEIGHT PARAMETERS; NAME=...", or one camera for all of them.
    names : sequence of str
        Names of the cameras; an empty one of a single camera.
    who : str
        What needs them, for messages.

    Returns
    -------
    tuple of ColmapCamera
        One a name.

    Raises
    ------
    UsageError
        As `camera_of`, and for a name that is missing, unknown or given twice.
    """
    if not text or "=" not in text:
        return (camera_of(text, who),) * len(names)
    models: dict[str, str] = {}
    for word in filter(None, (word.strip() for word in text.split(";"))):
        name, _, model = word.partition("=")
        if name.strip() not in names or name.strip() in models:
            problem = "stands twice" if name.strip() in models else "is not in the orientation"
            cameras = ", ".join(filter(None, names)) or "one without a name"
            raise UsageError(f"{who}: camera {name.strip()!r} {problem}; its cameras: {cameras}")
        models[name.strip()] = model
    if missing := [name for name in names if name not in models]:
        raise UsageError(
            f"{who}: camera {missing[0]!r} is missing; give each, such as --set"
            f" camera='{names[0]}=PINHOLE 5120 3840 5607 5607 2560 1920; {missing[0]}=...'"
        )
    return tuple(camera_of(models[name], who) for name in names)


def camera_of(text: str | None, who: str) -> ColmapCamera:
    """Parse the camera of `text`.

    Parameters
    ----------
    text : str, optional
        "MODEL WIDTH HEIGHT PARAMETERS".
    who : str
        What needs the camera, for messages.

    Returns
    -------
    ColmapCamera
        The camera.

    Raises
    ------
    UsageError
        A camera that is missing, of another model, or with another number of parameters.
    """
    if not text:
        raise UsageError.advised(f"{who} needs a calibrated camera", GIVE_CAMERA)
    fields = str(text).replace(",", " ").split()
    if fields[0] not in PARAMETER_NAMES:
        raise UsageError.advised(f"camera model {fields[0]!r} is none of COLMAP's", GIVE_CAMERA)
    if len(fields) < 3:
        raise UsageError.advised(f"camera {text!r} is not a model and numbers", GIVE_CAMERA)
    width, height = map(whole, fields[1:3])
    parameters = tuple(map(finite, fields[3:]))
    if min(width, height) < 0 or any(map(math.isnan, parameters)):
        raise UsageError.advised(f"camera {text!r} is not a model and numbers", GIVE_CAMERA)
    if len(parameters) != (count := len(PARAMETER_NAMES[fields[0]])):
        raise UsageError.advised(
            f"camera {fields[0]}: {len(parameters)} parameters, the model has {count}", GIVE_CAMERA
        )
    camera = ColmapCamera(fields[0], width, height, parameters)
    if min(width, height) <= 0 or min(camera.focal) <= 0.0:
        raise UsageError.advised(
            f"camera {text!r}: size and focal lengths must be positive", GIVE_CAMERA
        )
    return camera
