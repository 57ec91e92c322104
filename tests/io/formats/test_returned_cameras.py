"""Calibrations of other programs: each format of one camera gives the pixels of that camera."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pyproj import CRS

from insgnss.base.errors import InputError
from insgnss.geodesy.rotation import rotation_from_opk
from insgnss.io.formats.blocks.camera_files import CAMERA_FORMS, write_cameras
from insgnss.io.formats.blocks.camera_toml import write_camera_toml
from insgnss.io.formats.returned.cameras import (
    BY_FORMAT,
    read_camera,
    read_cameras,
    recognised_camera,
)
from insgnss.io.formats.returned.reading import read_returned_poses
from insgnss.records.block import INTERIOR, BrownCamera
from insgnss.records.cameras.camera import pixels_of

VALUES = {"f": 5606.998, "cx": 2590.441, "cy": 1971.87, "b1": 1.5}
VALUES |= {"k1": 0.01717, "k2": -0.06895, "k3": 0.07745, "p1": -0.00089, "p2": 0.00103}


def camera(**values: float) -> BrownCamera:
    of = VALUES | values
    return BrownCamera("c", 5120, 3840, np.array([of.get(name, 0.0) for name in INTERIOR]))


def seen(fx: float, fy: float, cx: float, cy: float, k: list[float], p: list[float]) -> np.ndarray:
    """OpenCV's formula of the manual: p[0] with 2 x y in x; pixels from the first one's corner."""
    x, y = rays().T
    r2 = x * x + y * y
    radial = 1.0 + k[0] * r2 + k[1] * r2**2 + k[2] * r2**3
    u = x * radial + 2.0 * p[0] * x * y + p[1] * (r2 + 2.0 * x * x)
    v = y * radial + p[0] * (r2 + 2.0 * y * y) + 2.0 * p[1] * x * y
    return np.column_stack([cx + fx * u, cy + fy * v])


def rays() -> np.ndarray:
    axes = np.meshgrid(np.linspace(-0.45, 0.45, 7), np.linspace(-0.33, 0.33, 5))
    return np.stack(axes, axis=-1).reshape(-1, 2)


K, P = [0.01717, -0.06895, 0.07745], [0.00103, -0.00089]
FX, FY, CX, CY = 5608.498, 5606.998, 2590.441, 1971.87
EXPECTED = seen(FX, FY, CX, CY, K, P)
SQUARE = seen(FY, FY, CX, CY, K, P)  # of formats with one focal length
PLAIN = seen(FX, FY, CX, CY, [0.0] * 3, [0.0] * 2)
ROS = f"""image_width: 5120
image_height: 3840
camera_name: c
camera_matrix:
  rows: 3
  cols: 3
  data: [{FX}, 0, {CX - 0.5},
         0, {FY}, {CY - 0.5}, 0, 0, 1]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [{K[0]}, {K[1]}, {P[0]}, {P[1]}, {K[2]}]
"""
OPENCV_XML = f"""<?xml version="1.0"?>
<opencv_storage><image_Width>5120</image_Width><image_Height>3840</image_Height>
<Camera_Matrix type_id="opencv-matrix"><rows>3</rows><cols>3</cols><dt>d</dt>
<data>{FX} 0. {CX - 0.5} 0. {FY} {CY - 0.5} 0. 0. 1.</data></Camera_Matrix>
<Distortion_Coefficients type_id="opencv-matrix"><rows>5</rows><cols>1</cols><dt>d</dt>
<data>{K[0]} {K[1]} {P[0]} {P[1]} {K[2]}</data></Distortion_Coefficients></opencv_storage>
"""
KALIBR = f"""cam0:
  cam_overlaps: []
  camera_model: pinhole
  distortion_coeffs: [0.0, 0.0, 0.0, 0.0]
  distortion_model: radtan
  intrinsics: [{FX}, {FY}, {CX - 0.5}, {CY - 0.5}]
  resolution: [5120, 3840]
  rostopic: /cam0/image_raw
"""
KALIBR_BLOCKS = KALIBR.replace(
    f"[{FX}, {FY}, {CX - 0.5}, {CY - 0.5}]",
    f"\n  - {FX}\n  - {FY}\n  - {CX - 0.5}\n  - {CY - 0.5}",
)
MM = 17.0 / 5120
PIX4D = f"""Pix4D camera calibration file 0
#Focal Length mm assuming a sensor width of 17.0x12.75mm
F {FY * MM!r}
#Principal Point mm
Px {CX * MM!r}
Py {CY * MM!r}
#Symmetrical Lens Distortion Coeffs
K1 {K[0]}
K2 {K[1]}
K3 {K[2]}
#Tangential Lens Distortion Coeffs
T1 {P[0]}
T2 {P[1]}
"""
PIX4D_POSES = "camera model m = K [R|-Rt] X\n\nIMG_1.jpg 5120 3840\n5607 0 2590\n0 5607 1971\n"
WEBODM = f"""{{"v2 c 5120 3840 brown 1.0": {{"projection_type": "brown", "width": 5120,
"height": 3840, "focal_x": {FX / 5120!r}, "focal_y": {FY / 5120!r}, "c_x": {(CX - 2560) / 5120!r},
"c_y": {(CY - 1920) / 5120!r}, "k1": {K[0]}, "k2": {K[1]}, "k3": {K[2]}, "p1": {P[0]},
"p2": {P[1]}}}}}"""
BENTLEY = f"""<BlocksExchange version="2.1"><Block><Photogroups><Photogroup><Name>c</Name>
<ImageDimensions><Width>5120</Width><Height>3840</Height></ImageDimensions>
<FocalLength>{FY * MM!r}</FocalLength><SensorSize>17.0</SensorSize>
<PrincipalPoint><x>{CX}</x><y>{CY}</y></PrincipalPoint><Distortion><K1>{K[0]}</K1><K2>{K[1]}</K2>
<K3>{K[2]}</K3><P1>{P[1]}</P1><P2>{P[0]}</P2></Distortion></Photogroup></Photogroups></Block>
</BlocksExchange>"""
INPHO = f"""$CAMERA
  $TYPE : c
  $KIND : CCDFrame
  $CCD_INTERIOR_ORIENTATION :
     {FX / 35.0!r} 0.0 {CX - 0.5}
     0.0 {-FY / 35.0!r} {CY - 0.5}
  $CCD_COLUMNS : 5120
  $CCD_ROWS : 3840
  $PIXEL_REFERENCE : CenterTopLeft
  $FOCAL_LENGTH : 35.0
  $PRINCIPAL_POINT_PPA : 0.0 0.0
$END
"""
METASHAPE = f"""<?xml version="1.0" encoding="UTF-8"?>
<calibration><projection>frame</projection><width>5120</width><height>3840</height><f>{FY}</f>
<cx>{CX - 2560}</cx><cy>{CY - 1920}</cy><b1>{FX - FY}</b1><k1>{K[0]}</k1><k2>{K[1]}</k2>
<k3>{K[2]}</k3><p1>{P[1]}</p1><p2>{P[0]}</p2></calibration>
"""
DBAT = """<document dbat_camera_version="1.0"><camera><id>1</id><name>c</name><unit>mm</unit>
<sensor>auto,12.75</sensor><image>5120,3840</image><aspect>1</aspect><skew>0</skew>
<focal>18.6</focal><model>3</model><nK>3</nK><nP>2</nP><cc>18.6</cc><pp>8.6,6.5</pp><K>0,0,0</K>
<P>0,0</P></camera></document>"""
FILES: dict[str, tuple[str, str, str, np.ndarray | None]] = {  # name, format, text, pixels
    "ROS": ("camera.yaml", "opencv", ROS, EXPECTED),
    "OpenCV's XML": ("camera.xml", "opencv", OPENCV_XML, EXPECTED),
    "Kalibr": ("camchain.yaml", "kalibr", KALIBR, PLAIN),
    "Kalibr's blocks": ("camchain.yaml", "kalibr", KALIBR_BLOCKS, PLAIN),
    "Pix4D": ("p_calibrated_internal_camera_parameters.cam", "pix4d", PIX4D, SQUARE),
    "WebODM": ("cameras.json", "opensfm", WEBODM, EXPECTED),
    "Bentley": ("block.xml", "bentley", BENTLEY, SQUARE),
    "Bentley's pixels that are not square": (
        "block.xml",
        "bentley",
        BENTLEY.replace(
            f"<FocalLength>{FY * MM!r}</FocalLength>",
            f"<FocalLength>{FX * MM!r}</FocalLength><AspectRatio>{FY / FX!r}</AspectRatio>",
        ),
        EXPECTED,
    ),
    "Inpho": ("a.prj", "inpho", INPHO, PLAIN),
    "Metashape": ("camera.xml", "metashape", METASHAPE, EXPECTED),
    "DBAT": ("camera.xml", "dbat", DBAT, None),
}


@pytest.mark.parametrize("name", FILES)
def test_a_camera_of_another_program(name: str, tmp_path: Path) -> None:
    """Oracle: OpenCV's formula on the numbers of the file; the contents show the format."""
    file, form, text, expected = FILES[name]
    (tmp_path / file).write_text(text)
    (tmp_path / "p_calibrated_camera_parameters.txt").write_text(PIX4D_POSES)
    assert recognised_camera(tmp_path / file) == form
    got = read_camera(tmp_path / file)
    assert (got.width, got.height) == (5120, 3840)
    if expected is None:
        assert got.backward
        return
    assert np.abs(pixels_of(got, rays()) - expected).max() < 1e-6


def test_a_bentley_camera_of_another_model_is_refused(tmp_path: Path) -> None:
    """Oracle: a fisheye taken as a frame camera is off by hundreds of pixels at its corners."""
    fisheye = "<CameraModelType>Fisheye</CameraModelType><FocalLength>"
    (tmp_path / "block.xml").write_text(BENTLEY.replace("<FocalLength>", fisheye))
    with pytest.raises(InputError, match=r"CameraModelType .*Fisheye"):
        read_camera(tmp_path / "block.xml")


QUARTERS = {
    "plain": [[1.0, 0.0], [0.0, -1.0]],
    "quarter": [[0.0, -1.0], [-1.0, 0.0]],
    "half": [[-1.0, 0.0], [0.0, 1.0]],
    "three quarters": [[0.0, 1.0], [1.0, 0.0]],
}


@pytest.mark.parametrize("direction", ["forward", "backward", "forward-p2x", "backward-p2x"])
@pytest.mark.parametrize("turn", QUARTERS)
def test_a_project_of_inpho_with_distortion(turn: str, direction: str, tmp_path: Path) -> None:
    """Oracle: collinearity in the photograph's axes (mm, y up), (I.2), and the project's matrix;
    of two calibrations of a camera the active one, and the CRS that stands there.
    """
    A, focal, centre = 217.39 * np.array(QUARTERS[turn]), 51.683, np.array([5798.578, 4358.137])
    K, P = [1e-4, -1.457e-5, 4.06e-9, -4.1e-14], [3.4e-6, 4.4e-6]
    R, X0 = rotation_from_opk(np.array([0.02, -0.03, 1.2])).T, np.array([500.0, 200.0, 900.0])
    numbers = "\n".join(" ".join(map(repr, row)) for row in R.tolist())
    (tmp_path / "a.prj").write_text(
        "$COORDINATE_SYSTEM_SET\n  $ID : any\n  $COORDINATE_SYSTEM : "
        f"{CRS('EPSG:25832').to_wkt('WKT1_GDAL', pretty=True)}\n$END_COORDINATE_SYSTEM\n"
        "$CAMERA_DEFINITION\n  $ID : nadir\n  $ACTIVE_CALIBRATION : 1\n"
        "  $CALIBRATION_SET :\n    $ID : 11\n    $FOCAL_LENGTH : 50\n    $END\n"
        "  $CALIBRATION_SET :\n    $ID : 1\n"
        "    $CCD_INTERIOR_ORIENTATION :\n"
        + "".join(f"{a} {b} {c}\n" for (a, b), c in zip(A.tolist(), centre, strict=True))
        + f"    $CCD_COLUMNS : 11608\n    $CCD_ROWS : 8708\n    $FOCAL_LENGTH : {focal}\n"
        f"    $RADIAL_COEFFS :\n {' '.join(map(repr, K))}\n 0 0 0 0\n"
        f"    $DECENTRE_COEFFS :\n {' '.join(map(repr, P))} 0 0\n    $END\n$END\n"
        "$PHOTO\n  $PHOTO_NUM : 1\n  $PHOTO_FILE : D:/1.tif\n  $CAMERA_ID : nadir\n"
        f"  $EXT_ORI : 12:00:00 01/01/2026\n {focal} 500.0 200.0 900.0\n{numbers}\n$END\n"
    )
    with pytest.raises(InputError, match=r"distortion \(80\.9 px at.* whether P1 or P2 is"):
        read_camera(tmp_path / "a.prj")
    (camera,) = read_cameras(tmp_path / "a.prj", direction=direction)
    poses = read_returned_poses(tmp_path / "a.prj", "inpho_prj")
    assert (poses.kind, poses.crs) == ("projected", "EPSG:25832")
    P = P[::-1] if direction.endswith("p2x") else P
    x = 0.6 * focal * rays()  # of image points, backward; else of ideal points
    r2 = np.sum(x * x, axis=1)[:, None]
    moved = (
        x * (1.0 + sum(k * r2**n for n, k in enumerate(K))) + P * r2 + 2.0 * (x @ P)[:, None] * x
    )
    image, ideal = (moved, x) if direction.startswith("forward") else (x, moved)
    uv = image @ A.T + centre + 0.5
    ground = X0 + 700.0 * np.column_stack([ideal / focal, -np.ones(len(x))]) @ R
    d = (ground - poses.position[0]) @ poses.C[0]
    assert np.abs(pixels_of(camera, d[:, :2] / d[:, 2:]) - uv).max() < 1e-6


@pytest.mark.parametrize("form", ["toml", *CAMERA_FORMS])
def test_what_is_written_is_read(form: str, tmp_path: Path) -> None:
    """Oracle: the pixels of the camera that was written."""
    path = tmp_path / {"toml": "c.toml", "colmap": "cameras.txt"}.get(form, "camera.any")
    if form == "toml":
        write_camera_toml(camera(), path)
    else:
        assert write_cameras([camera()], path, form) == ()
    assert recognised_camera(path) == form
    got = read_camera(path)
    assert np.abs(pixels_of(got, rays()) - EXPECTED).max() < 1e-9


RADIAL = [0.03, -0.02, 0.004, -0.001]
FISHEYES = {  # file, text
    "ROS": (
        "camera.yaml",
        ROS.replace("plumb_bob", "equidistant").replace(
            f"[{K[0]}, {K[1]}, {P[0]}, {P[1]}, {K[2]}]", str(RADIAL)
        ),
    ),
    "Kalibr": (
        "camchain.yaml",
        KALIBR.replace("radtan", "equidistant").replace("[0.0, 0.0, 0.0, 0.0]", str(RADIAL)),
    ),
    "WebODM": (
        "cameras.json",
        WEBODM.replace('"brown"', '"fisheye_opencv"')
        .replace(f'"k1": {K[0]}, "k2": {K[1]}, "k3": {K[2]}, "p1": {P[0]},\n"p2": {P[1]}', "")
        .replace(
            f"{(CY - 1920) / 5120!r}, ",
            f"{(CY - 1920) / 5120!r}, "
            + str({f"k{n}": k for n, k in enumerate(RADIAL, start=1)})
            .strip("{}")
            .replace("'", '"'),
        ),
    ),
    "Metashape": (
        "camera.xml",
        METASHAPE.replace(">frame<", ">fisheye<").replace(
            f"<k1>{K[0]}</k1><k2>{K[1]}</k2>\n<k3>{K[2]}</k3><p1>{P[1]}</p1><p2>{P[0]}</p2>",
            "".join(f"<k{n}>{k}</k{n}>" for n, k in enumerate(RADIAL, start=1)),
        ),
    ),
}


def fisheye_pixels() -> np.ndarray:
    """OpenCV's formula of cv::fisheye: theta_d = theta (1 + k1 theta^2 + ... + k4 theta^8)."""
    x, y = 2.0 * rays().T
    r = np.hypot(x, y) + 1e-12
    theta = np.arctan(r)
    scale = theta * (1.0 + sum(k * theta ** (2 * n) for n, k in enumerate(RADIAL, start=1))) / r
    return np.column_stack([CX + FX * scale * x, CY + FY * scale * y])


@pytest.mark.parametrize("name", FISHEYES)
def test_a_fisheye_of_another_program(name: str, tmp_path: Path) -> None:
    """Oracle: OpenCV's formula; what is written of it is read in every format."""
    file, text = FISHEYES[name]
    (tmp_path / file).write_text(text)
    got = read_camera(tmp_path / file)
    assert got.model == "fisheye"
    assert np.abs(pixels_of(got, 2.0 * rays()) - fisheye_pixels()).max() < 1e-6
    for form in CAMERA_FORMS:
        path = tmp_path / {"colmap": "cameras.txt"}.get(form, "written.any")
        assert write_cameras([got], path, form) == ()
        again = read_camera(path)
        assert again.model == "fisheye"
        assert np.abs(pixels_of(again, 2.0 * rays()) - fisheye_pixels()).max() < 1e-6


def test_every_format_has_a_case() -> None:
    """Oracle: the registry."""
    assert {form for _, form, _, _ in FILES.values()} | {"toml", "colmap"} == set(BY_FORMAT)


def changed(text: str, old: str, new: str) -> Callable[[Path], Path]:
    def write(root: Path) -> Path:
        assert old in text or old == "x"
        (root / "x.any").write_text(text.replace(old, new))
        return root / "x.any"

    return write


@pytest.mark.parametrize(
    ("write", "why"),
    [
        (changed(ROS, "plumb_bob", "equidistant"), "5 coefficients; a fisheye has k1 to k4"),
        (changed(ROS, f", {K[2]}]", f", {K[2]}, 0.1, 0, 0]"), "a rational polynomial"),
        (changed(ROS, "image_width", "width_of_image"), "needs image_width"),
        (changed(KALIBR, "radtan", "fov"), "read is pinhole radtan, equidistant, none"),
        (changed(PIX4D, "F ", "F "), "lacks the image size in pixels"),
        (
            changed(INPHO, "$END", "$RADIAL_COEFFS : 0 1e-5\n$END"),
            "does not say the direction of its distortion",
        ),
        (changed(WEBODM, '"brown"', '"fisheye62"'), "is not Brown's"),
        (
            changed("1 THIN_PRISM_FISHEYE 9 9 1 1 5 5 0 0 0 0 0 0 1 0\n", "x", "x"),
            "thin-prism terms",
        ),
        (changed("1 FOV 10 10 1 1 5 5 0.1\n2 PINHOLE 10 10 1 1 5 5\n", "x", "x"), "not Brown's"),
        (changed("1 PINHOLE 9 9 1 1 5 5\n2 PINHOLE 9 9 1 1 5 5\n", "x", "x"), "has 2 cameras"),
        (changed("nothing", "n", "n"), "is not recognised as a calibrated camera"),
    ],
)
def test_cameras_that_are_refused(write: Callable[[Path], Path], why: str, tmp_path: Path) -> None:
    """Oracle: what Brown's model has, and what a file says."""
    with pytest.raises(InputError, match=why):
        read_camera(write(tmp_path))


def test_a_camera_that_cannot_be_names_its_file(tmp_path: Path) -> None:
    """Oracle: a focal length of zero; a path that is none."""
    (tmp_path / "c.json").write_text(WEBODM.replace(f"{FY / 5120!r}", "0.0"))
    with pytest.raises(InputError, match=r"c\.json: camera v2 c .*each must be positive"):
        read_camera(tmp_path / "c.json")
    with pytest.raises(InputError, match=r"none\.xml: .*check the path of the camera"):
        read_camera(tmp_path / "none.xml")


def test_several_cameras(tmp_path: Path) -> None:
    """Oracle: COLMAP's numbers of the cameras."""
    path = tmp_path / "cameras.txt"
    write_cameras([camera(), camera(f=4000.0)], path)
    assert [one.name for one in read_cameras(tmp_path)] == ["1", "2"]
