"""Calibrated cameras of any program, data_specs/camera_files.md: contents tell the format.

    toml        camera.toml of insgnss                       colmap     cameras.txt
    metashape   <calibration>, project, XML of cameras       opensfm    cameras.json, reconstruction
    opencv      YAML or XML of cv::FileStorage, ROS          kalibr     camchain, pinhole
    pix4d       .cam; sizes from the file of poses beside    bentley    BlocksExchange
    inpho       $CAMERA of a project                         dbat       scripts and camera files

Pixels of OpenCV and Kalibr count from the centre of the first pixel: 0.5 is added.
"""

import re
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from ....base.errors import InputError, UsageError, near
from ....base.inputs import first_bytes
from ....records.block import Array, BrownCamera
from ..blocks.camera_toml import read_camera_toml
from ..blocks.colmap_model import brown_of
from ..blocks.dbat import read_dbat_cameras
from ..blocks.metashape_block import read_metashape_cameras
from ..blocks.opensfm_model import read_opensfm_cameras
from ..bundle.camera import brown_camera, camera_of, of_opencv
from ..text.layout import decode, quote
from ..text.numbers import finite, whole
from ..text.text import Source, decode_text
from ..text.xml import read_xml
from .inpho import read_inpho_cameras

CAMERA_HEAD_BYTES = 1 << 14  # bytes by which a format is told: comments before a camera are shorter
KALIBR = ("radtan", "equidistant", "none")  # distortions of its pinhole cameras
KALIBR_KEYS = ("camera_model", "distortion_model", "intrinsics", "resolution", "distortion_coeffs")
# first pixel's centre from its outer corner (px): OpenCV counts from the centre
CENTRE_SHIFT_PX = 0.5
PERSPECTIVE = "Perspective"  # the model of a Bentley camera that is no fisheye
CAMERA_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][-+]?\d+)?"
Cameras = tuple[BrownCamera, ...]


def read_cameras(path: Source, form: str = "auto", direction: str | None = None) -> Cameras:
    """Read the calibrated cameras of a file.

    Parameters
    ----------
    path : path
        The file, or a directory with a model of COLMAP.
    form : str
        A key of `BY_FORMAT`; "auto": what the contents show.
    direction : str, optional
        Of the distortion of Inpho, whose files alone do not say it, as `inpho` takes it.

    Returns
    -------
    tuple of BrownCamera
        At least one.

    Raises
    ------
    UsageError
        A format that is unknown.
    InputError
        No camera, one of another model than Brown's, or what its reader refuses.
    """
    path = Path(path) / "cameras.txt" if Path(path).is_dir() else Path(path)
    form = recognised_camera(path) if form == "auto" else form
    if form not in BY_FORMAT:
        raise UsageError(f"cameras as {form!r}; {near(form, BY_FORMAT)}")
    try:
        inpho = form == "inpho"
        cameras = read_inpho_cameras(path, direction) if inpho else BY_FORMAT[form](path)
    except InputError as error:  # of the camera itself, which knows no file
        if error.location:
            raise
        raise InputError.in_file(path, str(error)) from None
    if not cameras:
        raise InputError.in_file(path, f"has no calibrated camera ({form}); export it again")
    return cameras


def read_camera(path: Source) -> BrownCamera:
    """Read the one camera of a file, as options that take a camera do.

    Parameters
    ----------
    path : path
        As of `read_cameras`.

    Returns
    -------
    BrownCamera
        The camera.

    Raises
    ------
    InputError
        As `read_cameras`, or several cameras.
    """
    cameras = read_cameras(path)
    if len(cameras) > 1:
        names = ", ".join(quote(camera.name) for camera in cameras[:3])
        raise InputError.in_file(
            path,
            f"has {len(cameras)} cameras ({names}), one is needed: write one to a file by insgnss"
            " camera --name",
        )
    return cameras[0]


def recognised_camera(path: Path) -> str:
    """Return the format of a file of cameras, a key of `BY_FORMAT`; InputError where it is none."""
    if path.suffix.lower() in (".psx", ".psz"):
        return "metashape"
    if path.suffix.lower() == ".toml":
        return "toml"
    text = decode(first_bytes(path, CAMERA_HEAD_BYTES, "check the path of the camera"))
    for form, pattern in CAMERA_FILE_HEADS.items():
        if re.search(pattern, text, re.MULTILINE):
            return form
    raise InputError.in_file(
        path, f"is not recognised as a calibrated camera; readable are {', '.join(BY_FORMAT)}"
    )


def _opencv_camera(
    path: Path, name: str, size: tuple[str | None, ...], K: Array, D: Array, fisheye: bool
) -> BrownCamera:
    """Return a camera of OpenCV's parameters: fx, fy, cx, cy, and k1 k2 p1 p2 [k3 [k4 k5 k6]].

    Those of a fisheye are k1 to k4.
    """
    if fisheye and D.size != 4:
        raise InputError.in_file(
            path, f"camera {name}: {D.size} coefficients; a fisheye has k1 to k4"
        )
    rational = np.concatenate([D, np.zeros(max(0, 8 - D.size))])
    if np.any(rational[8:]):
        raise InputError.in_file(
            path,
            f"camera {name}: has thin-prism or tilt terms, which Brown's polynomial lacks;"
            " calibrate without them",
        )
    parameters = [*size, *map(repr, (K + (0.0, 0.0, CENTRE_SHIFT_PX, CENTRE_SHIFT_PX)).tolist())]
    model, term_count = ("OPENCV_FISHEYE", 4) if fisheye else ("FULL_OPENCV", 8)
    parameters += map(repr, rational[:term_count].tolist())
    return _camera_of_words(path, name, f"{model} " + " ".join(map(str, parameters)))


def _camera_of_words(path: Path, name: str, text: str) -> BrownCamera:
    """Return a camera in COLMAP's notation."""
    try:
        camera = camera_of(text, "camera")
    except UsageError as error:
        raise InputError.in_file(path, error.problem) from None
    return brown_of(path, name, camera)


def _numbers(path: Path, text: str, key: str) -> Array:
    values = np.array([finite(word) for word in re.findall(CAMERA_NUMBER, text)])
    if not values.size or not np.isfinite(values).all():
        raise InputError.in_file(path, f"{key} {quote(text)} has no numbers; export it again")
    return values


def _opencv(path: Path) -> Cameras:
    """Return the camera of a calibration file of OpenCV's FileStorage, YAML or XML."""
    text = decode_text(path)
    fisheye = re.search(r"distortion_model:\s*[\"']?(equidistant|fisheye)", text) is not None

    def block(key: str) -> str:
        yaml = re.search(rf"(?i)\b{key}:[^\[]*?data:\s*\[([^\]]*)\]", text)
        xml = re.search(rf"(?is)<{key}\b.*?<data>(.*?)</data>", text)
        match = yaml or xml
        if match is None:
            raise InputError.in_file(path, f"no {key}; write the file by cv::FileStorage")
        return match[1]

    def side(key: str) -> str | None:
        match = re.search(rf"(?i)\b{key}(?:>|:)\s*(\d+)", text)
        return match[1] if match else None

    K = _numbers(path, block("camera_matrix"), "camera_matrix")
    D = _numbers(path, block("distortion_coefficients"), "distortion_coefficients")
    size = side("image_width"), side("image_height")
    if K.size != 9 or None in size:
        raise InputError.in_file(path, "needs image_width, image_height and a matrix of 9")
    return (_opencv_camera(path, path.stem, size, K[[0, 4, 2, 5]], D, fisheye),)


def _kalibr(path: Path) -> Cameras:
    """Return the cameras of a camchain.yaml of Kalibr."""
    cameras = []
    for name, body in re.findall(r"(?ms)^(cam\d+):[ \t]*\n(.*?)(?=^\S|\Z)", decode_text(path)):
        matches = {
            key: re.search(rf"(?m)^\s+{key}:((?:.*\n?)(?:\s+-.*\n?)*)", body) for key in KALIBR_KEYS
        }
        value = {key: match[1].strip() if match else "" for key, match in matches.items()}
        distortion = value["distortion_model"]
        if value["camera_model"] != "pinhole" or distortion not in KALIBR:
            model = f"{value['camera_model']} {distortion}"
            raise InputError.in_file(
                path, f"camera {name}: {quote(model)}; read is pinhole {', '.join(KALIBR)}"
            )
        K = _numbers(path, value["intrinsics"], "intrinsics")
        size = tuple(re.findall(r"\d+", value["resolution"]))
        D = np.zeros(4)
        if distortion != "none" and matches["distortion_coeffs"]:
            D = _numbers(path, value["distortion_coeffs"], "distortion_coeffs")
        if K.size != 4 or len(size) != 2:
            raise InputError.in_file(path, f"camera {name}: needs 4 intrinsics and a resolution")
        cameras.append(_opencv_camera(path, name, size, K, D, distortion == "equidistant"))
    return tuple(cameras)


def _colmap(path: Path) -> Cameras:
    rows = [row.split(maxsplit=1) for row in decode_text(path).splitlines() if row.strip()]
    return tuple(
        _camera_of_words(path, row[0], row[1]) for row in rows if row[0][0] != "#" and row[1:]
    )


def _pix4d(path: Path) -> Cameras:
    sections = re.split(r"Pix4D camera calibration file\s+(\S+)", decode_text(path))[1:]
    cameras = []
    for name, body in zip(sections[::2], sections[1::2], strict=True):
        value = {key: finite(word) for key, word in re.findall(r"(?m)^(\w\w?) (\S+)\s*$", body)}
        sensor = re.search(rf"sensor width of ({CAMERA_NUMBER})x({CAMERA_NUMBER})", body)
        if sensor is None or not {"F", "Px", "Py"} <= set(value):
            raise InputError.in_file(path, f"camera {name}: no F, Px, Py or sensor; copy again")
        width, height = _pix4d_size(path)
        per_mm = width / float(sensor[1])
        of = {key.lower(): value.get(key, 0.0) for key in ("K1", "K2", "K3")}
        of |= {"f": per_mm * value["F"], "cx": per_mm * value["Px"], "cy": per_mm * value["Py"]}
        of |= {"p1": value.get("T1", 0.0), "p2": value.get("T2", 0.0)}
        cameras.append(brown_camera(name, width, height, of_opencv(of)))
    return tuple(cameras)


def _pix4d_size(path: Path) -> tuple[int, int]:
    """Return the size of the images, which a .cam does not have: of the first image beside it."""
    for parameter_file in sorted(path.parent.glob("*_calibrated_camera_parameters.txt")):
        if match := re.search(
            r"(?m)^\S.* (\d+) (\d+)\s*\n\S+ 0 \S+\s*$", decode_text(parameter_file)
        ):
            return whole(match[1]), whole(match[2])
    raise InputError.in_file(
        path,
        "lacks the image size in pixels; copy <project>_calibrated_camera_parameters.txt beside it",
    )


def _bentley(path: Path) -> Cameras:
    cameras: list[BrownCamera] = []
    for group in read_xml(path).iter("Photogroup"):
        name = (group.findtext("Name") or f"camera {len(cameras) + 1}").strip()

        def value(key: str, default: float, group: object = group, name: str = name) -> float:
            text = group.findtext(key)  # type: ignore[attr-defined]
            number = default if text is None else finite(text)
            if not np.isfinite(number):
                raise InputError.in_file(path, f"camera {name}: {key} {quote(text)}")
            return number

        width, height = value("ImageDimensions/Width", 0.0), value("ImageDimensions/Height", 0.0)
        f = value("FocalLengthPixels", 0.0)
        if not f and (sensor := value("SensorSize", 0.0)) > 0.0:
            f = value("FocalLength", 0.0) / sensor * max(width, height)
        if not f:
            continue
        kind = (group.findtext("CameraModelType") or PERSPECTIVE).strip()
        if kind != PERSPECTIVE:
            message = f"camera {name}: CameraModelType {quote(kind)} cannot be read"
            raise InputError.in_file(path, f"{message}; export the camera from another program")
        of = {
            key.lower(): value(f"Distortion/{key}", 0.0) for key in ("K1", "K2", "K3", "P1", "P2")
        }
        # the focal length is that along x; the aspect ratio takes it to that along y
        of["f"] = f * value("AspectRatio", 1.0)
        of |= {"b1": f - of["f"], "b2": value("Skew", 0.0)}
        of["cx"] = value("PrincipalPoint/x", 0.5 * width)
        of["cy"] = value("PrincipalPoint/y", 0.5 * height)
        cameras.append(brown_camera(name, width, height, of))
    return tuple(cameras)


BY_FORMAT: Mapping[str, Callable[[Path], Cameras]] = {
    "toml": lambda path: (read_camera_toml(path),),
    "metashape": read_metashape_cameras,
    "opencv": _opencv,
    "kalibr": _kalibr,
    "colmap": _colmap,
    "pix4d": _pix4d,
    "opensfm": read_opensfm_cameras,
    "bentley": _bentley,
    "inpho": read_inpho_cameras,
    "dbat": read_dbat_cameras,
}
"""Readers of calibrated cameras by the names of their formats."""
CAMERA_FILE_HEADS = {
    "pix4d": r"Pix4D camera calibration file",
    "bentley": r"<BlocksExchange\b",
    "opencv": r"(?i)<opencv_storage\b|^camera_matrix:",
    "dbat": r"dbat_(script|camera)_version",
    "metashape": r"<(calibration|document|chunk)\b",
    "kalibr": r"^cam\d+:",
    "inpho": r"^\s*\$CAMERA(_DEFINITION)?\s*$",
    "opensfm": r"\A\s*[\[{].*",
    "colmap": r"^\d+ [A-Z_]+ \d+ \d+ ",
    "toml": r"^model\s*=",
}
