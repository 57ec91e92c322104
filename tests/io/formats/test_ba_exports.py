"""Every format for bundle adjustments: read by a minimal reader of the tool's convention, points
re-projected; worked example; refusals.
"""

import json
import re
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from ba_scene import (
    LAT0,
    LON0,
    Array,
    D,
    Place,
    assert_reprojects,
    block,
    boresight,
    camera_of,
    exterior,
    framed,
    worked,
)
from draws import normal_draws
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from insgnss.base.errors import DataError, InputError, UsageError
from insgnss.io.formats.bundle.bentley import write_bentley
from insgnss.io.formats.bundle.inpho import write_inpho_ascii, write_inpho_prj
from insgnss.io.formats.bundle.metashape import (
    write_metashape,
    write_metashape_offset,
    write_metashape_opk,
)
from insgnss.io.formats.bundle.micmac import write_micmac, write_micmac_xml
from insgnss.io.formats.bundle.odm import write_odm_geo
from insgnss.io.formats.bundle.opensfm import write_opensfm
from insgnss.io.formats.bundle.pix4d import write_pix4d_mapper, write_pix4d_matic
from insgnss.io.formats.bundle.realitycapture import (
    write_realitycapture,
    write_realitycapture_accuracy,
)
from insgnss.io.formats.exports import EXPORTS
from insgnss.io.formats.orientation.eo_local_plane import write_eo_local_plane

Read = list[tuple[Place, Array, bool]]


def opk(values: list[float]) -> Array:
    """Camera (x right, y down) of omega phi kappa in degrees: scipy's intrinsic XYZ, then D."""
    return Rotation.from_euler("XYZ", values, degrees=True).as_matrix() @ D


def ypr(values: list[float]) -> Array:
    """Camera of yaw pitch roll in degrees: Rz(-yaw) Rx(pitch) Ry(roll), then D."""
    return (
        Rotation.from_euler("ZXY", [-values[0], values[1], values[2]], degrees=True).as_matrix() @ D
    )


def fields(path: Path, separator: str | None = None) -> list[list[str]]:
    return [
        line.split(separator)
        for line in path.read_text().splitlines()
        if line and not line.startswith("#")
    ]


def numbers(path: Path, separator: str | None = ",") -> list[list[float]]:
    return [[float(x) for x in row[1:]] for row in fields(path, separator)]


def read_metashape_ypr(path: Path, where: str) -> Read:
    return [(Place(where, np.array(v[:3])), ypr(v[3:6]), True) for v in numbers(path)]


def read_axes_opk(path: Path, where: str) -> Read:
    return [(Place(where, np.array(v[:3])), opk(v[3:6]), False) for v in numbers(path)]


def read_offset(path: Path, where: str) -> Read:
    """Reference rotation = R_cam D ypr2mat(offset): the camera is what is left when the offset is
    taken off again.
    """
    text = path.with_name(f"{path.stem}_gps_ins_offset.txt").read_text()
    stated = re.search(r"Yaw, Pitch, Roll \(deg\): (.*)", text)
    angles = [float(x) for x in stated[1].split(",")]  # type: ignore[index]
    offset = ypr(angles) @ D
    return [
        (place, C @ D @ offset.T @ D, north) for place, C, north in read_metashape_ypr(path, where)
    ]


def read_matic(path: Path, where: str) -> Read:
    first = [1, 0, 2] if where == "geographic" else [0, 1, 2]
    return [(Place(where, np.array(v[:3])[first]), ypr(v[3:6]), True) for v in numbers(path)]


def read_realitycapture(path: Path, where: str) -> Read:
    return read_matic(path, where)


def read_opensfm(path: Path, where: str) -> Read:
    reference = json.loads(path.with_name("reference_lla.json").read_text())
    assert_allclose(
        [reference["latitude"], reference["longitude"]], [LAT0, LON0], rtol=0, atol=1e-12
    )
    axes = Place("tangent plane", np.zeros(3)).axes
    out: Read = []
    for shot in json.loads(path.read_text()).values():
        gps, a = shot["gps"], shot["opk"]
        place = Place("geographic", np.array([gps["longitude"], gps["latitude"], gps["altitude"]]))
        place.axes = axes
        to_camera = (
            D
            @ Rotation.from_euler(
                "ZYX", [-a["kappa"], -a["phi"], -a["omega"]], degrees=True
            ).as_matrix()
        )
        out.append((place, to_camera.T, False))
    return out


def read_micmac(path: Path, where: str) -> Read:
    head, *_ = path.read_text().splitlines()
    assert head == "#F=N X Y Z W P K Ix Iy Iz"
    return [(Place(where, np.array(v[:3])), opk(v[3:6]), False) for v in numbers(path, None)]


def read_micmac_xml(path: Path, where: str) -> Read:
    out: Read = []
    for file in sorted(path.glob("Orientation-*.tif.xml")):
        outer = ET.parse(file).getroot().find("OrientationConique/Externe")
        assert outer is not None
        centre = np.array(outer.findtext("Centre").split(), dtype=float)  # type: ignore[union-attr]
        texts = [outer.findtext(f"ParamRotation/CodageMatr/L{i}") for i in (1, 2, 3)]
        rows = [text.split() for text in texts]  # type: ignore[union-attr]
        out.append((Place(where, centre), np.array(rows, dtype=float), False))
    return out


def read_bentley(path: Path, where: str) -> Read:
    root = ET.parse(path).getroot()
    definition = root.findtext("SpatialReferenceSystems/SRS/Definition")
    assert (
        root.findtext("Block/Photogroups/Photogroup/CameraOrientation", "XRightYDown")
        == "XRightYDown"
    )
    out: Read = []
    for photo in root.iter("Photo"):
        pose = photo.find("Pose/Metadata")
        assert pose is not None
        M = np.array(
            [
                [float(pose.findtext(f"Rotation/M_{i}{j}", "nan")) for j in range(3)]
                for i in range(3)
            ]
        )
        x = np.array([float(pose.findtext(f"Center/{axis}", "nan")) for axis in "xyz"])
        if definition is not None and definition.startswith(
            "ENU:"
        ):  # its origin lies on the ellipsoid
            assert_allclose(
                [float(v) for v in definition[4:].split(",")], [LAT0, LON0], rtol=0, atol=1e-12
            )
            x = x - [0, 0, 412.5]
        else:
            assert definition == ("EPSG:4326" if where == "geographic" else where)
        out.append((Place(where, x), M.T, False))
    return out


def read_inpho_prj(path: Path, where: str) -> Read:
    out: Read = []
    for photo in path.read_text().split("$PHOTO\n")[1:]:
        lines = photo.splitlines()
        at = next(k for k, line in enumerate(lines) if "$EXT_ORI" in line)
        focal, *x = (float(v) for v in lines[at + 1].split())
        assert focal == 20.2
        M = np.array([line.split() for line in lines[at + 2 : at + 5]], dtype=float)
        out.append((Place(where, np.array(x)), M.T @ D, False))
    return out


def read_inpho_ascii(path: Path, where: str) -> Read:
    return [(Place(where, np.array(v[:3])), opk(v[3:6]), False) for v in numbers(path, None)]


def write_prj(eo: object, path: Path) -> None:
    write_inpho_prj(eo, path, focal_mm=20.2, ground_m=510.0)  # type: ignore[arg-type]


GRIDS = ("EPSG:2056", "EPSG:32632")
CASES: list[tuple[Callable[..., None], Callable[[Path, str], Read], tuple[str, ...]]] = [
    (write_metashape, read_metashape_ypr, ("geographic", "tangent plane", *GRIDS)),
    (write_metashape_opk, read_axes_opk, ("geographic", "tangent plane", *GRIDS)),
    (write_metashape_offset, read_offset, ("geographic", "tangent plane", *GRIDS)),
    (write_pix4d_matic, read_matic, ("geographic", *GRIDS)),
    (write_pix4d_mapper, read_axes_opk, ("tangent plane", *GRIDS)),
    (write_opensfm, read_opensfm, ("tangent plane",)),
    (write_micmac, read_micmac, ("tangent plane", "geocentric")),
    (write_micmac_xml, read_micmac_xml, ("tangent plane", "geocentric")),
    (write_realitycapture, read_realitycapture, ("geographic", "tangent plane")),
    (write_realitycapture_accuracy, read_realitycapture, ("geographic", "tangent plane")),
    (write_bentley, read_bentley, ("tangent plane", "geographic", *GRIDS)),
    (write_prj, read_inpho_prj, ("tangent plane", *GRIDS)),
    (write_inpho_ascii, read_inpho_ascii, ("tangent plane", *GRIDS)),
]


@pytest.mark.parametrize(
    ("write", "read", "where"), [(w, r, f) for w, r, frames in CASES for f in frames]
)
def test_points_reproject_from_the_written_file(
    write: Callable[..., None], read: Callable[[Path, str], Read], where: str, tmp_path: Path
) -> None:
    """Oracle: a reader of the tool's convention by scipy and pyproj; 0.02 px of a 5607 px camera, 3
    km from the origin.
    """
    eo = block()
    write(framed(eo, where), tmp_path / "out")
    assert_reprojects(eo, read(tmp_path / "out", where))


def test_the_reprojection_notices_what_it_is_for(tmp_path: Path) -> None:
    """Oracle: the sizes of the mistakes: convergence of LV95 0.66 deg, true north 3 km away 1 arc
    minute.
    """
    eo = block()
    write_metashape(framed(eo, "EPSG:2056"), tmp_path / "a")
    write_eo_local_plane(framed(eo, "tangent plane"), tmp_path / "b")
    without_convergence = [
        (place, C, False) for place, C, _ in read_metashape_ypr(tmp_path / "a", "EPSG:2056")
    ]
    rows = [[float(x) for x in row[1:]] for row in fields(tmp_path / "b")]
    assert_reprojects(
        eo, [(Place("tangent plane", np.array(v[:3])), opk(v[3:6]), False) for v in rows]
    )
    places = [
        Place("geographic", np.degrees(x[:2]).tolist() + [x[2]])
        for x in framed(eo, "geographic").coordinates
    ]  # type: ignore[arg-type]
    for wrong in (
        without_convergence,
        [(place, opk(v[3:6]), False) for place, v in zip(places, rows, strict=True)],
    ):
        with pytest.raises(AssertionError):
            assert_reprojects(eo, wrong, 1.0)


def test_worked_example(tmp_path: Path) -> None:
    """Oracle: formats.md 0.2, printed to 6 decimals of a degree; Bentley's angles through M^T = Rx
    Ry Rz without D.
    """
    plane, geographic = worked("tangent plane"), worked("geographic")
    write_micmac(plane, tmp_path / "m")
    assert_allclose(
        numbers(tmp_path / "m", None)[0][3:6], [0.931051, 4.374505, -137.600874], rtol=0, atol=2e-6
    )
    write_metashape_opk(geographic, tmp_path / "o")
    assert_allclose(
        numbers(tmp_path / "o")[0][3:6], [0.931051, 4.374505, -137.600874], rtol=0, atol=2e-6
    )
    for write in (write_metashape, write_pix4d_matic, write_realitycapture):
        write(geographic, tmp_path / "y")
        assert_allclose(
            numbers(tmp_path / "y")[0][3:6], [137.648029, -3.636396, -2.605228], rtol=0, atol=2e-6
        )
    write_bentley(geographic, tmp_path / "b")
    M_t = read_bentley(tmp_path / "b", "geographic")[0][1]
    assert_allclose(
        M_t.T,
        [
            [-0.736314, -0.675117, 0.045363],
            [-0.672327, 0.737532, 0.063424],
            [-0.076275, 0.016202, -0.996955],
        ],
        atol=6e-7,
    )
    assert_allclose(
        Rotation.from_matrix(M_t).as_euler("XYZ", degrees=True),
        [-179.068949, -4.374505, 137.600874],
        rtol=0,
        atol=2e-6,
    )


def test_nominal_camera_and_offset_of_metashape(tmp_path: Path) -> None:
    """Oracle: formats.md B1.4: 137.1048 -2.9982 -2.0027 for the worked example, -0.5130 +0.6621
    +0.5681 for Table 2 of paper 000.
    """
    write_metashape_offset(worked(), tmp_path / "ms.csv")
    assert_allclose(numbers(tmp_path / "ms.csv")[0][3:6], [137.1048, -2.9982, -2.0027], atol=6e-5)
    text = (tmp_path / "ms_gps_ins_offset.txt").read_text()
    stated = re.search(r"Yaw, Pitch, Roll \(deg\): (.*)", text)
    offset = [float(x) for x in stated[1].split(",")]  # type: ignore[index]
    assert_allclose(offset, [-0.5130, 0.6621, 0.5681], atol=6e-5)
    published = np.array([-0.513, 0.657, 0.574])
    assert_allclose(
        offset, published, atol=0.0065
    )  # carried over angle by angle, from Rx Ry Rz to Rz Rx Ry
    assert np.abs(np.array(offset) - published).max() > 0.004
    x_y_z = Rotation.from_euler(
        "XYZ", [-published[1], published[2], published[0]], degrees=True
    ).as_matrix()
    assert_allclose(x_y_z, boresight(), atol=2e-6)
    assert "bore-sight not applied in the angles of the csv" in text


@pytest.mark.parametrize(
    "where", ["geographic", "EPSG:2056", "EPSG:3413", "tangent plane"]
)  # EPSG:3413: convergence 52 deg
def test_sigmas_of_metashape(where: str, tmp_path: Path) -> None:
    """Oracle: Monte Carlo of exp(psi) R through scipy's angles (4000 draws); axes by pyproj."""
    eo = block(2)
    frame = framed(eo, where)
    plane = Place("tangent plane", np.zeros(3)).axes
    for write, order, north in (
        (write_metashape, "ZXY", True),
        (write_metashape_opk, "XYZ", False),
    ):
        write(frame, tmp_path / "x")
        for k, v in enumerate(numbers(tmp_path / "x")):
            place = Place(where, np.array(v[:3]))
            A = (place.north_axes if north else place.axes).T @ plane
            psi = normal_draws(A @ eo.cov[k, 3:, 3:] @ A.T, 4000, seed=4)
            drawn = np.unwrap(
                (Rotation.from_rotvec(psi) * Rotation.from_matrix(A @ eo.C_mc[k] @ D)).as_euler(
                    order
                ),
                axis=0,
            )
            assert_allclose(v[9:12], np.degrees(drawn.std(axis=0, ddof=1)), rtol=0.003)
            F = place.axes.T @ plane
            assert_allclose(v[6:9], np.sqrt(np.diag(F @ eo.cov[k, :3, :3] @ F.T)), atol=1e-5)


def test_single_accuracies(tmp_path: Path) -> None:
    """Oracle: their definition: root mean squares of standard deviations, by numpy on the record's
    covariance.
    """
    eo = block(2)
    for write, where, separator, at in (
        (write_pix4d_matic, "geographic", ",", 6),
        (write_odm_geo, "EPSG:2056", None, 6),
    ):
        frame = framed(eo, where)
        write(frame, tmp_path / "x")
        text = (tmp_path / "x").read_text()
        rows = [line.split(separator) for line in text.splitlines() if line.startswith("800")]
        for k, row in enumerate(rows):
            var = np.diag(frame.cov[k])
            assert_allclose(
                [float(v) for v in row[at + 1 :]],
                [np.sqrt((var[0] + var[1]) / 2), np.sqrt(var[2])],
                atol=1e-5,
            )
    write_opensfm(framed(eo, "tangent plane"), tmp_path / "exif_overrides.json")
    shot = json.loads((tmp_path / "exif_overrides.json").read_text())["8002.tif"]
    var = np.diag(eo.cov[1])
    assert shot["gps"]["dop"] == pytest.approx(np.sqrt(var[:3].mean()), abs=1e-5)
    assert shot["opk"]["accuracy"] == pytest.approx(np.degrees(np.sqrt(var[3:].mean())), abs=1e-6)


def test_odm_geo(tmp_path: Path) -> None:
    """Oracle: formats.md B3: the CRS in line 1, comments after it, x first, angles NaN."""
    for where, head in (("geographic", "EPSG:4326"), ("EPSG:32632", "EPSG:32632")):
        frame = framed(block(2), where)
        write_odm_geo(frame, tmp_path / "geo.txt")
        first, *rest = (tmp_path / "geo.txt").read_text().splitlines()
        assert first == head
        row = next(line for line in rest if not line.startswith("#")).split()
        x = (
            frame.coordinates[0]
            if where != "geographic"
            else [*np.degrees(frame.coordinates[0, :2]), frame.coordinates[0, 2]]
        )
        assert_allclose([float(v) for v in row[1:4]], x, rtol=0, atol=0.6e-4)
        assert row[4:7] == ["NaN"] * 3


def test_axis_order_of_matic(tmp_path: Path) -> None:
    """Oracle: EPSG's axis order: EPSG:31468 counts northing first, EPSG:25832 easting first."""
    from insgnss.geodesy.projection import MapProjection
    from insgnss.navigation.orient.frame import in_frame

    eo = exterior(camera_of(*np.zeros((3, 1))), np.zeros((1, 3)))
    for code, first in (("EPSG:3034", "northing"), ("EPSG:25832", "easting")):
        frame = in_frame(eo, "projected", MapProjection(code))
        write_pix4d_matic(frame, tmp_path / "x.csv")
        head, row = (tmp_path / "x.csv").read_text().splitlines()
        assert head.startswith(f"#imagename,{first} ({code}")
        order = [1, 0] if first == "northing" else [0, 1]
        assert_allclose(
            [float(v) for v in row.split(",")[1:3]],
            frame.coordinates[0, order],
            rtol=0,
            atol=0.6e-4,
        )


def test_bentley_camera(tmp_path: Path) -> None:
    """Oracle: the vendor's page: an explicit camera, or ManualOpticalParams false, which takes it
    from the images.
    """
    eo = worked("geographic")
    write_bentley(eo, tmp_path / "b.xml", width_px=5120, height_px=3840, focal_px=5607)
    group = ET.parse(tmp_path / "b.xml").getroot().find("Block/Photogroups/Photogroup")
    assert group is not None
    assert [
        group.findtext(tag)
        for tag in ("ImageDimensions/Width", "ImageDimensions/Height", "CameraOrientation")
    ] == [
        "5120",
        "3840",
        "XRightYDown",
    ]
    assert float(group.findtext("FocalLengthPixels", "nan")) == 5607.0
    write_bentley(eo, tmp_path / "b.xml")
    assert ET.parse(tmp_path / "b.xml").getroot().findtext(".//ManualOpticalParams") == "false"
    with pytest.raises(UsageError, match="belong together"):
        write_bentley(eo, tmp_path / "b.xml", width_px=5120)
    write_bentley(replace(eo, images=("a & <b>.tif",), history=("a -- b",)), tmp_path / "b.xml")
    assert ET.parse(tmp_path / "b.xml").getroot().findtext(".//ImagePath") == "a & <b>.tif"


def test_inpho_photo_block(tmp_path: Path) -> None:
    """Oracle: formats.md B9; 3 July 2018 is day 2 of GPS week 2008, 199800 s = 07:30:00 of it."""
    eo = worked("tangent plane")
    write_inpho_prj(eo, tmp_path / "x.prj", focal_mm=20.2, ground_m=510.0, camera="digicam")
    lines = [line.strip() for line in (tmp_path / "x.prj").read_text().splitlines()]
    assert lines[0] == "$PHOTO"
    assert lines[-1] == "$END"
    for line in (
        "$PHOTO_NUM : 8001",
        "$PHOTO_FILE : 8001.tif",
        "$CAMERA_ID : digicam",
        "$TERRAIN_HEIGHT : 510.000",
        "$EXT_ORI : 07:30:00 03/07/2018",
    ):
        assert line in lines
    with pytest.raises(UsageError, match="needs focal_mm"):
        write_inpho_prj(eo, tmp_path / "y.prj")
    write_inpho_ascii(replace(eo, time=eo.time + 604800.0), tmp_path / "z")
    assert numbers(tmp_path / "z", None)[0][-1] == 199_800.0
    (tmp_path / "z").unlink()
    twins = replace(framed(block(2), "tangent plane"), images=("a.tif", "a.jpg"))
    with pytest.raises(InputError, match="same identifier 'a'"):
        write_inpho_ascii(twins, tmp_path / "y")


def test_reference_of_opensfm_is_not_replaced(tmp_path: Path) -> None:
    """Oracle: the same export again is the same reference; another one is refused, and nothing
    written.
    """
    write_opensfm(worked("tangent plane"), tmp_path / "exif_overrides.json")
    write_opensfm(worked("tangent plane"), tmp_path / "exif_overrides.json")
    (tmp_path / "reference_lla.json").write_text('{"latitude": 1, "longitude": 2, "altitude": 3}')
    (tmp_path / "exif_overrides.json").unlink()
    with pytest.raises(UsageError, match="holds another reference than this export"):
        write_opensfm(worked("tangent plane"), tmp_path / "exif_overrides.json")
    assert not (tmp_path / "exif_overrides.json").exists()


def test_frames_that_a_format_cannot_carry(tmp_path: Path) -> None:
    """Oracle: the frames of each format's page; the refusal names them, and nothing is written."""
    cannot: list[tuple[str, str]] = [
        ("metashape", "geocentric"),
        ("eo_local_plane", "EPSG:2056"),
        ("pix4d_matic", "tangent plane"),
        ("pix4d_mapper", "geographic"),
        ("odm", "tangent plane"),
        ("opensfm", "geographic"),
        ("micmac", "EPSG:32632"),
        ("micmac_xml", "EPSG:32632"),
        ("realitycapture", "EPSG:2056"),
        ("bentley", "geocentric"),
        ("inpho_prj", "geographic"),
        ("inpho_ascii", "geographic"),
    ]
    for name, where in cannot:
        with pytest.raises(UsageError, match=r"cannot carry a .* frame .*; it takes ") as refusal:
            EXPORTS[name].write(framed(block(1), where), tmp_path / "x")
        assert "\n" not in str(refusal.value)
    no_code = framed(block(1), "EPSG:2056")
    no_code = replace(no_code, frame=replace(no_code.frame, crs=""))
    for write in (write_odm_geo, write_bentley):
        with pytest.raises(UsageError, match="has no EPSG code"):
            write(no_code, tmp_path / "x")
    assert not list(tmp_path.iterdir())


def test_names_and_attitudes_that_a_format_cannot_hold(tmp_path: Path) -> None:
    """Oracle: the separators; phi = 90 deg of a camera that looks west along the horizon, pitch =
    90 deg of one that looks north.
    """
    for write, where, name in (
        (write_metashape_opk, "geographic", "a,b"),
        (write_pix4d_mapper, "tangent plane", "a,b"),
        (write_odm_geo, "geographic", "a b"),
        (write_micmac, "tangent plane", "a b"),
        (write_micmac_xml, "tangent plane", "a/b"),
        (write_micmac_xml, "tangent plane", "a\\b"),
        (write_realitycapture, "geographic", "a,b"),
        (write_inpho_ascii, "tangent plane", "a b.tif"),
    ):
        with pytest.raises(InputError, match="rename"):
            write(replace(framed(block(1), where), images=(name,)), tmp_path / "x")
    west = np.column_stack([[0.0, 1, 0], [0, 0, -1], [-1, 0, 0]])
    north = np.column_stack([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    for write, C in ((write_micmac, west), (write_inpho_ascii, west), (write_metashape, north)):
        with pytest.raises(DataError, match=r"middle angle of .* is -?90\.0000 deg"):
            write(framed(exterior(C[None], np.zeros((1, 3))), "tangent plane"), tmp_path / "x")
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.parametrize("write", [w for w, _, _ in CASES if w is not write_micmac_xml])
def test_many_images(write: Callable[..., None], tmp_path: Path) -> None:
    """Oracle: the number of images written across the pieces that are formatted at once."""
    where = {write_pix4d_matic: "geographic", write_realitycapture: "geographic"}.get(
        write, "tangent plane"
    )
    eo = framed(
        exterior(
            camera_of(*np.random.default_rng(1).uniform(-5, 5, (3, 20_050))), np.zeros((20_050, 3))
        ),
        where,
    )
    write(eo, tmp_path / "x")
    text = (tmp_path / "x").read_text()
    assert {str(8001 + k) for k in range(20_050)} <= set(re.findall(r"\d+", text))
    if write is write_opensfm:
        assert len(json.loads(text)) == 20_050
    if write is write_bentley:
        assert len(ET.fromstring(text.encode()).findall(".//Photo")) == 20_050
