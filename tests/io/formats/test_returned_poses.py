"""What bundle adjustments give back: the layouts as their programs write them, put together here
from scipy's rotations, or by the program's own package, read back to the poses that they are of.
"""

import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from ba_scene import Array, D, block, framed
from format_pages import UNREADABLE, on_page
from numpy.testing import assert_allclose
from oracles import oracle
from pyproj import CRS
from scipy.spatial.transform import Rotation

from insgnss.base.errors import InputError, UsageError
from insgnss.io.formats.blocks.ground_points import GroundAxes
from insgnss.io.formats.bundle.bentley import write_bentley
from insgnss.io.formats.bundle.colmap import write_colmap
from insgnss.io.formats.bundle.inpho import write_inpho_prj
from insgnss.io.formats.bundle.micmac import write_micmac_xml
from insgnss.io.formats.returned.crs import kind_of_definition, kind_of_wkt
from insgnss.io.formats.returned.reading import RETURNED, read_returned_poses, returned_form
from insgnss.photogrammetry.comparison.hints import Hints
from insgnss.photogrammetry.comparison.reading import read_poses
from insgnss.photogrammetry.mounting_calibration.poses import read_camera_poses
from insgnss.records import FramedOrientation

OFFSET = np.array([2530000.0, 1158000.0, 500.0])
PINHOLE = "SIMPLE_PINHOLE 5120 3840 5607 2560 1920"
Writer = Callable[[FramedOrientation, Path], Path]


def opk_deg(C: Array) -> Array:
    """Intrinsic XYZ of the camera right, up, back, by scipy."""
    return np.asarray(Rotation.from_matrix(C @ D).as_euler("XYZ", degrees=True))


def joined(*values: object, by: str = " ") -> str:
    return by.join(x if isinstance(x, str) else f"{x:.10f}" for x in values) + "\n"


def metashape_opk_text(eo: FramedOrientation, path: Path) -> Path:
    """Metashape, Export cameras, Omega Phi Kappa: names without ending, matrix frame to camera."""
    text = f"# Cameras ({len(eo.images)})\n"
    text += "# PhotoID, X, Y, Z, Omega, Phi, Kappa, r11, r12, r13, r21, r22, r23, r31, r32, r33\n"
    for name, x, C in zip(eo.images, eo.coordinates, eo.C_fc, strict=True):
        R = (C @ D).T.reshape(9)
        text += joined(name.partition(".")[0], *x, *opk_deg(C), *R, by="\t")
    (path / "cameras.txt").write_text(text)
    return path / "cameras.txt"


def metashape_reference(eo: FramedOrientation, path: Path) -> Path:
    """Metashape, Export reference: WKT 1 with the datum's shift, estimated values, one without."""
    wkt = CRS.from_epsg(2056).to_wkt("WKT1_GDAL").replace("\n", "")
    shift = 'SPHEROID["Bessel 1841",6377397.155,299.1528128,AUTHORITY["EPSG","7004"]],TOWGS84['
    wkt = wkt.replace(shift.removesuffix("TOWGS84["), shift + "674.374,15.056,405.346,0,0,0,0],")
    assert "TOWGS84" in wkt
    text = f"# CoordinateSystem: {wkt}\n#Label,X/Easting,Y/Northing,Z/Altitude,Omega,Phi,Kappa,"
    text += "Error_(m),X_est,Y_est,Z_est,Omega_est,Phi_est,Kappa_est\n"
    for name, x, C in zip(eo.images, eo.coordinates, eo.C_fc, strict=True):
        first = [*(x + 3.0), 1.0, 2.0, 3.0, 5.0]
        text += joined(name, *first, *x, *opk_deg(C), by=",")
    text += "9999.tif,2531000,1158000,600,,,,,,,,,,\n"
    (path / "reference.csv").write_text(text)
    return path / "reference.csv"


def metashape_reference_ypr(eo: FramedOrientation, path: Path) -> Path:
    """The same with yaw, pitch, roll of true north, in a projected CRS, tabs between."""
    text = f"# CoordinateSystem: {CRS.from_epsg(2056).to_wkt('WKT1_GDAL')}\n".replace("\n ", " ")
    text += "#Label\tX_est\tY_est\tZ_est\tYaw_est\tPitch_est\tRoll_est\n"
    for name, x, C in zip(eo.images, eo.coordinates, eo.C_Ec, strict=True):
        a, p, r = Rotation.from_matrix(C @ D).as_euler("ZXY", degrees=True)
        text += joined(name, *x, -a, p, r, by="\t")
    (path / "reference.txt").write_text(text)
    return path / "reference.txt"


def beside_pix4d(path: Path) -> None:
    (path / "p_offset.xyz").write_text(joined(*OFFSET))
    (path / "p_wkt.prj").write_text(CRS.from_epsg(2056).to_wkt("WKT1_GDAL"))


def pix4d_external(eo: FramedOrientation, path: Path) -> Path:
    beside_pix4d(path)
    text = "imageName X Y Z Omega Phi Kappa\n"
    for name, x, C in zip(eo.images, eo.coordinates - OFFSET, eo.C_fc, strict=True):
        text += joined(name, *x, *opk_deg(C))
    (path / "p_calibrated_external_camera_parameters.txt").write_text(text)
    return path / "p_calibrated_external_camera_parameters.txt"


def pix4d_camera(eo: FramedOrientation, path: Path) -> Path:
    beside_pix4d(path)
    text = "fileName imageWidth imageHeight \ncamera matrix K [3x3]\nradial distortion [3x1]\n"
    text += "tangential distortion [2x1]\ncamera position t [3x1]\ncamera rotation R [3x3]\n"
    text += "camera model m = K [R|-Rt] X\n\n"
    for name, x, C in zip(eo.images, eo.coordinates - OFFSET, eo.C_fc, strict=True):
        text += f"{name} 5120 3840\n5607 0 2560\n0 5607 1920\n0 0 1\n0.1 0.2 0.3\n0.01 0.02\n"
        text += joined(*x) + "".join(joined(*row) for row in C.T)
    (path / "p_calibrated_camera_parameters.txt").write_text(text)
    return path / "p_calibrated_camera_parameters.txt"


def opensfm(eo: FramedOrientation, path: Path) -> Path:
    """doc/source/dataset.rst: rotation vector of world to camera, translation -R C."""
    lat, lon, height = eo.frame.origin
    shots = {
        name: {
            "rotation": Rotation.from_matrix(C.T).as_rotvec().tolist(),
            "translation": (-C.T @ x).tolist(),
            "camera": "v2",
        }
        for name, x, C in zip(eo.images, eo.coordinates, eo.C_fc, strict=True)
    }
    place = {"latitude": np.degrees(lat), "longitude": np.degrees(lon), "altitude": height}
    model = {"cameras": {"v2": {"projection_type": "fisheye"}}, "shots": shots, "points": {}}
    (path / "reconstruction.json").write_text(json.dumps([model | {"reference_lla": place}]))
    return path / "reconstruction.json"


def ign_opk(eo: FramedOrientation, path: Path) -> Path:
    text = "NOM\tX\tY\tZ\tO\tP\tK\tCAMERA\n"
    for name, x, C in zip(eo.images, eo.coordinates, eo.C_fc, strict=True):
        text += joined(name.partition(".")[0], *x, *opk_deg(C), "UCE-M3-f120-s06", by="   ")
    (path / "poses.OPK").write_text(text)
    return path / "poses.OPK"


def metashape_xml(eo: FramedOrientation, path: Path) -> Path:
    """Export cameras, Agisoft XML: transforms into the chunk, the chunk's into ECEF."""
    rows = ""
    for k, (name, x, C) in enumerate(zip(eo.images, eo.coordinates, eo.C_fc, strict=True)):
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = C, x
        numbers = " ".join(f"{v:.12f}" for v in T.ravel())
        rows += f'<camera id="{k}" label="{name}"><transform>{numbers}</transform></camera>'
    chunk = "<transform><rotation>1 0 0 0 1 0 0 0 1</rotation><translation>0 0 0</translation>"
    chunk += "<scale>1</scale></transform>"
    reference = f"<reference>{CRS.from_epsg(4326).to_wkt('WKT1_GDAL')}</reference>"
    text = f'<document version="2.0.0"><chunk label="c"><cameras>{rows}</cameras>'
    (path / "cameras.xml").write_text(f"{text}{reference}{chunk}</chunk></document>")
    return path / "cameras.xml"


def bentley(eo: FramedOrientation, path: Path) -> Path:
    write_bentley(eo, path / "blocks.xml")
    return path / "blocks.xml"


def inpho(eo: FramedOrientation, path: Path) -> Path:
    write_inpho_prj(eo, path / "inpho.prj", focal_mm=35.0, ground_m=500.0)
    return path / "inpho.prj"


def micmac(eo: FramedOrientation, path: Path) -> Path:
    write_micmac_xml(eo, path / "Ori-X")
    return path / "Ori-X"


def colmap(eo: FramedOrientation, path: Path) -> Path:
    write_colmap(eo, path / "model", PINHOLE)
    return path / "model"


def colmap_binary(eo: FramedOrientation, path: Path) -> Path:
    """pycolmap's own binary model."""
    pycolmap = oracle("pycolmap")
    write_colmap(eo, path / "text", PINHOLE, shift=(0.0, 0.0, 0.0))
    (path / "binary").mkdir()
    pycolmap.Reconstruction(str(path / "text")).write_binary(str(path / "binary"))
    return path / "binary"


CASES: dict[str, tuple[Writer, str, str, str]] = {  # writer, frame, format, kind and CRS read
    "metashape_opk_text": (metashape_opk_text, "EPSG:2056", "metashape_opk_text", " "),
    "metashape_reference": (
        metashape_reference,
        "EPSG:2056",
        "metashape_reference",
        "projected EPSG:2056",
    ),
    "metashape_reference ypr": (
        metashape_reference_ypr,
        "EPSG:2056",
        "metashape_reference",
        "projected EPSG:2056",
    ),
    "metashape_xml": (metashape_xml, "geocentric", "metashape_xml", "geocentric "),
    "pix4d_external": (pix4d_external, "EPSG:2056", "pix4d_external", "projected EPSG:2056"),
    "pix4d_camera": (pix4d_camera, "EPSG:2056", "pix4d_camera", "projected EPSG:2056"),
    "opensfm": (opensfm, "tangent plane", "opensfm", "tangent plane "),
    "micmac": (micmac, "geocentric", "micmac_xml", " "),
    "micmac local": (micmac, "tangent plane", "micmac_xml", " "),
    "bentley": (bentley, "EPSG:32632", "bentley", "projected EPSG:32632"),
    "bentley geographic": (bentley, "geographic", "bentley", "geographic "),
    "ign_opk": (ign_opk, "EPSG:2056", "ign_opk", " "),
    "inpho": (inpho, "EPSG:2056", "inpho_prj", " "),
    "colmap": (colmap, "EPSG:2056", "colmap", " "),
    "colmap binary": (colmap_binary, "tangent plane", "colmap", " "),
}


@pytest.mark.parametrize("name", CASES)
def test_poses_read_back(tmp_path: Path, name: str) -> None:
    """Oracle: the scene; scipy's angles, pycolmap's model; the file shows its own format."""
    write, where, form, kind = CASES[name]
    eo = framed(block(), where)
    path = write(eo, tmp_path)
    head = "" if path.is_dir() else path.read_bytes()[:16384].decode("latin-1")
    assert returned_form(path, head) == form
    got = read_returned_poses(path, form)
    assert tuple(image.partition(".")[0] for image in got.images) == tuple(
        image.partition(".")[0] for image in eo.images
    )
    assert f"{got.kind} {got.crs}" == kind
    scale = [6.4e6, 6.4e6, 1.0] if where == "geographic" else 1.0
    assert np.abs((got.position - eo.coordinates) * scale).max() < 2e-4
    C = eo.C_Ec if got.true_north else eo.C_fc
    assert np.abs(got.C - C).max() < 1e-8
    if got.angles is not None:
        assert got.angles.shape == (len(eo.images), 3)
    assert got.origin == (pytest.approx(eo.frame.origin) if name == "opensfm" else ())
    if name == "metashape_reference":
        assert got.notes == ("1 images without estimated pose are left out",)


@pytest.mark.parametrize(("unit", "factor"), [("grades", 1 / 0.9), ("degrés", 1.0)])
def test_ign_with_lines_above_its_header(tmp_path: Path, unit: str, factor: float) -> None:
    """Oracle: the same file without them; 100 grades are 90 deg."""
    path = ign_opk(framed(block(), "EPSG:2056"), tmp_path)
    plain = read_returned_poses(path, "ign_opk")
    head, *rows = path.read_text().splitlines()
    fields = [row.split() for row in rows]
    rows = [
        joined(*row[:4], *(factor * float(angle) for angle in row[4:7]), row[7]) for row in fields
    ]
    text = f"CHANTIER : x\nPROJECTION : LAMBERT93\nUNITE ANGLE  : {unit}\n{head}\n"
    path.write_text(text + "".join(rows))
    assert returned_form(path, path.read_text()) == "ign_opk"
    assert np.abs(read_returned_poses(path, "ign_opk").C - plain.C).max() < 1e-9
    path.write_text(text.replace(unit, "mil") + "".join(rows))
    with pytest.raises(InputError, match=":3: angles in 'mil'"):
        read_returned_poses(path, "ign_opk")


def test_every_format_has_a_case() -> None:
    """Oracle: the registry; five are read in photogrammetry/comparison/test_ways_back.py."""
    others = {"odm", "odm_shots", "opf", "geojson", "positions"}
    assert {form for _, _, form, _ in CASES.values()} | others == set(RETURNED)


def test_the_page_reads(tmp_path: Path) -> None:
    """Oracle: the numbers of the page; both examples are the same image, one less its offset."""
    for form in ("metashape_opk_text", "pix4d_external"):
        (tmp_path / form).write_text(on_page("returned", form))
    a = read_returned_poses(tmp_path / "metashape_opk_text", "metashape_opk_text")
    b = read_returned_poses(tmp_path / "pix4d_external", "pix4d_external")
    assert_allclose(a.C, b.C)
    assert_allclose(a.position - b.position, [[2530000.0, 1158000.0, 0.0]])
    assert "no <project>_offset.xyz beside it" in b.notes[0]


def test_bentley_of_angles_and_other_axes(tmp_path: Path) -> None:
    """Oracle: the vendor's sample (formats.md B8): the angles of this matrix with XRightYDown; up
    in the image is the other way round; an adjusted pose goes before the imported one.
    """
    photo = "<Photo><ImagePath>a/{}.jpg</ImagePath>{}</Photo>"
    turned = "<Rotation><Omega>179.65234715</Omega><Phi>0.04985630</Phi><Kappa>179.90654657</Kappa>"
    centre = "<Center><x>1</x><y>2</y><z>3</z></Center>"
    adjusted = (
        f"<Pose>{turned}</Rotation>{centre}<Metadata>{centre.replace('1', '9')}</Metadata></Pose>"
    )
    groups = "".join(
        f"<Photogroup><CameraOrientation>{axes}</CameraOrientation>{photo.format(axes, adjusted)}"
        "</Photogroup>"
        for axes in ("XRightYDown", "XRightYUp", "XDownYLeft")
    )
    lone = f"<Photogroup>{photo.format('none', '')}</Photogroup>"
    text = (
        "<BlocksExchange><SpatialReferenceSystems><SRS><Id>4</Id><Definition>ENU:46.5,6.5</Definition>"
        f"</SRS></SpatialReferenceSystems><Block><SRSId>4</SRSId>{groups}{lone}</Block></BlocksExchange>"
    )
    (tmp_path / "b.xml").write_text(text)
    got = read_returned_poses(tmp_path / "b.xml", "bentley")
    R = Rotation.from_euler("XYZ", [179.65234715, 0.04985630, 179.90654657], degrees=True)
    assert_allclose(got.C[0], R.as_matrix(), atol=1e-12)
    assert_allclose(got.C[1], R.as_matrix() @ D, atol=1e-12)
    # x down and y left in the image: x of the program is our y, its y our -x
    axes = np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])
    assert_allclose(got.C[2], R.as_matrix() @ axes, atol=1e-12)
    assert got.position.tolist() == [[1.0, 2.0, 3.0]] * 3
    assert got.kind == "tangent plane"
    assert_allclose(np.degrees(got.origin[:2]), [46.5, 6.5])
    assert got.notes == ("1 photographs without pose are left out",)


def test_bentley_of_a_group_with_its_own_system(tmp_path: Path) -> None:
    """Oracle: its specification: SRSId of a photogroup stands in for that of the block; heading,
    pitch, roll are its third form of a rotation, which is named.
    """
    write_bentley(framed(block(), "EPSG:32632"), tmp_path / "b.xml")
    text = (tmp_path / "b.xml").read_text()
    text = re.sub(r"\s*<SRSId>0</SRSId>", "", text)
    (tmp_path / "b.xml").write_text(text)
    assert read_returned_poses(tmp_path / "b.xml", "bentley").kind == ""
    text = text.replace("<Photogroup>", "<Photogroup><SRSId>0</SRSId>")
    (tmp_path / "b.xml").write_text(text)
    assert read_returned_poses(tmp_path / "b.xml", "bentley").crs == "EPSG:32632"
    angles = "<Rotation><Heading>1</Heading><Pitch>2</Pitch><Roll>3</Roll></Rotation>"
    text = re.sub("<Rotation>.*?</Rotation>", angles, text, flags=re.DOTALL)
    (tmp_path / "b.xml").write_text(text)
    with pytest.raises(InputError, match="has Heading, Pitch, Roll; export matrices"):
        read_returned_poses(tmp_path / "b.xml", "bentley")


LV95 = (  # as Metashape writes it
    'PROJCS["CH1903+ / LV95",GEOGCS["CH1903+",DATUM["CH1903+",SPHEROID["Bessel 1841",6377397.155,'
    '299.1528128,AUTHORITY["EPSG","7004"]],TOWGS84[674.374,15.056,405.346,0,0,0,0],AUTHORITY["EPSG'
    '","6150"]],PRIMEM["Greenwich",0,AUTHORITY["EPSG","8901"]],UNIT["degree",0.01745329251994328,'
    'AUTHORITY["EPSG","9102"]],AUTHORITY["EPSG","4150"]],PROJECTION["Oblique_Mercator",AUTHORITY['
    '"EPSG","9815"]],PARAMETER["latitude_of_center",46.95240555555561],PARAMETER["longitude_of_cent'
    'er",7.439583333333329],PARAMETER["azimuth",90],PARAMETER["recitified_grid_angle",90],PARAMETER'
    '["scale_factor",1],PARAMETER["false_easting",2600000],PARAMETER["false_northing",1200000],UNIT'
    '["metre",1,AUTHORITY["EPSG","9001"]],AUTHORITY["EPSG","2056"]]'
)


def test_a_text_that_ends_with_a_code_is_that_crs() -> None:
    """Oracle: the code at its end, where the parameters are its own; commas may be lost."""
    assert kind_of_wkt(LV95, "a.txt") == ("projected", "EPSG:2056")
    assert kind_of_wkt(LV95.replace(",", " "), "a.txt") == ("projected", "EPSG:2056")
    (lat,), (lon,), _ = GroundAxes(LV95).geodetic(np.array([[2600000.0, 1200000.0, 500.0]]))
    assert np.degrees([lat, lon]) == pytest.approx([46.95108, 7.43864], abs=1e-4)  # Bern
    moved = CRS("EPSG:32632").to_wkt("WKT1_GDAL").replace("500000", "600000")
    assert kind_of_wkt(moved, "a.txt")[1] != "EPSG:32632"


def test_both_versions_of_micmac_read_alike(tmp_path: Path) -> None:
    """Oracle: one image of MicMac's own test data in its two forms, of two adjustments that agree
    to 3 mm and 0.1 deg.
    """
    first, second = tmp_path / "Ori-V1", tmp_path / "Ori-V2"
    first.mkdir()
    second.mkdir()
    rows = (
        "-0.162381354909888115 0.0970335704412158828 -0.981945406723336411",
        "0.0383177901210033506 0.99502246827372054 0.091989317807644036",
        "0.985983794257223933 -0.022688627942266542 -0.165291208550925994",
    )
    text = "".join(f"<L{k}>{row}</L{k}>" for k, row in enumerate(rows, start=1))
    centre = "<Centre>5.20448828567060851 1.49496779535545343 2.11770763380631921</Centre>"
    (first / "Orientation-IMGP4167.JPG.xml").write_text(
        f"<ExportAPERO><Externe>{centre}<KnownConv>eConvApero_DistM2C</KnownConv>{text}</Externe>"
        "</ExportAPERO>"
    )
    (second / "Ori-PerspCentral-IMGP4167.JPG.xml").write_text(
        '<?xml version="1.0" encoding="ISO8859-1" standalone="yes" ?>\n<MMVII_Serialization>'
        "<Center>5.20644436052294 1.49611001038881 2.11724479232937</Center><RotMatrix>"
        "<AxeI>-0.162074830392862 0.0384131738848583 0.986030515463501</AxeI>"
        "<AxeJ>0.0965180346057596 0.995067755113336 -0.0229004744393625</AxeJ>"
        "<AxeK>-0.982046851402196 0.0914581369031654 -0.164983001685735</AxeK></RotMatrix>"
        "</MMVII_Serialization>"
    )
    a, b = (read_returned_poses(path, returned_form(path, "")) for path in (first, second))
    assert a.images == b.images == ("IMGP4167.JPG",)
    assert np.abs(a.position - b.position).max() < 3e-3
    assert np.abs(a.C - b.C).max() < 2e-3


def test_damaged_files_are_one_line(tmp_path: Path) -> None:
    """Oracle: what is wrong with each."""
    eo = framed(block(), "EPSG:2056")
    opk, camera = metashape_opk_text(eo, tmp_path), pix4d_camera(eo, tmp_path)
    text = opk.read_text()
    for change, message in (
        (text.replace("8002\t", "8002\t1\t"), r":4: 17 fields, expected 16"),
        (text.replace("\t0.9", "\t0.5"), "matrix is not that of omega"),
        ("# nothing\n", "no image has a pose"),
        (text + text.splitlines()[-1] + "\n", "occurs twice"),
    ):
        opk.write_text(change)
        with pytest.raises(InputError, match=message):
            read_returned_poses(opk, "metashape_opk_text")
    whole = camera.read_text()
    for change, message in (
        (whole.rpartition("\n0.01 0.02")[0], "an image has 10 lines"),
        (whole.replace("0.9", "0.5"), "is no rotation"),
    ):
        camera.write_text(change)
        with pytest.raises(InputError, match=message):
            read_returned_poses(camera, "pix4d_camera")
    with pytest.raises(InputError, match=r"is in degrees; give <project>_calibrated_external"):
        read_returned_poses(
            pix4d_external(eo, tmp_path).rename(
                tmp_path / "p_calibrated_external_camera_parameters_wgs84.txt"
            ),
            "pix4d_external",
        )
    (tmp_path / "b.xml").write_text("<BlocksExchange><Block>")
    with pytest.raises(InputError, match="is no XML"):
        read_returned_poses(tmp_path / "b.xml", "bentley")
    (tmp_path / "i.prj").write_text("$PHOTO\n  $PHOTO_NUM : 1\n$END\n")
    with pytest.raises(InputError, match="no image has a pose"):
        read_returned_poses(tmp_path / "i.prj", "inpho_prj")
    with pytest.raises(InputError, match="the CRS 'PROJCS nonsense' is unknown"):
        kind_of_wkt("PROJCS nonsense", "x")
    with pytest.raises(UsageError, match="did you mean 'bentley'"):
        read_returned_poses(tmp_path / "b.xml", "bently")


PLACES = {  # of a number that is read, in a file of each case
    "metashape_opk_text": r"(?<=8001\t)[^\t]*",
    "metashape_reference": r"(?<=8002\.tif,)(.*,)[^,]*(?=\n)",
    "metashape_reference ypr": r"(?<=8002\.tif\t)(.*\t)[^\t]*(?=\n)",
    "pix4d_external": r"(?<=8001\.tif )[^ ]*",
    "ign_opk": r"(?<=8001   )[^ ]*",
    "pix4d_camera": r"(?<=\n0\.01 0\.02\n)[^ ]*",
    "micmac": r"(?<=<L2>)[^ ]*",
    "bentley": r"(?<=<M_11>)[^<]*",
    "bentley geographic": r"(?<=<z>)[^<]*",
    "inpho": r"(?<=2018\n)(\s+[-.\d]+\s+)[-.\d]+",
    "colmap": r"(?<=\n2 )[^ ]*",
}


@pytest.mark.parametrize("name", PLACES)
def test_a_value_that_cannot_be_read_is_named(tmp_path: Path, name: str) -> None:
    """Oracle: the value that was written."""
    write, where, form, _ = CASES[name]
    path = write(framed(block(), where), tmp_path)
    file = next(path.glob("Orientation-*"), path / "images.txt") if path.is_dir() else path
    place = re.search(PLACES[name], file.read_text())
    assert place is not None
    head, tail = place.string[: place.start()], place.string[place.end() :]
    for value in UNREADABLE:
        file.write_text(f"{head}{''.join(place.groups(''))}{value}{tail}", encoding="utf-8")
        with pytest.raises(InputError, match=re.escape(str(file))) as refusal:
            read_returned_poses(path, form)
        assert value in str(refusal.value)


@pytest.mark.parametrize(
    ("name", "old", "new", "message"),
    [
        ("metashape_reference", "8002.tif,", "8002.tif,1,", "fields, the header has"),
        ("pix4d_external", "8001.tif ", "8001.tif 1,", ":2: 8 fields, expected 7"),
        (
            "bentley",
            "<Metadata><SRSId>0<",
            "<Metadata><SRSId>7<",
            "SRSId '7' is not among the <SRS> of",
        ),
        (
            "bentley",
            "<Photogroup>",
            "<Photogroup><CameraOrientation/>",
            "Orientation '' is unknown",
        ),
        ("colmap", "# shift: ", "# shift: 1 # ", "where a finite number must stand"),
    ],
)
def test_what_once_was_taken_for_something_else(
    tmp_path: Path, name: str, old: str, new: str, message: str
) -> None:
    """Oracle: the fault that was written; decimal commas moved the columns behind them."""
    write, where, form, _ = CASES[name]
    path = write(framed(block(), where), tmp_path)
    file = path / "images.txt" if path.is_dir() else path
    assert old in file.read_text()
    file.write_text(file.read_text().replace(old, new, 1))
    with pytest.raises(InputError, match=re.escape(message)):
        read_returned_poses(path, form)


@pytest.mark.parametrize(
    "origin", ["46.5", "46,5,6,5", "6.5\N{MINUS SIGN},6", "nan,6", "91,6", "1_0,6"]
)
def test_an_origin_that_is_none(origin: str) -> None:
    """Oracle: a latitude up to 90 degrees, a longitude and perhaps a height."""
    with pytest.raises(InputError, match="is not ENU:latitude,longitude"):
        kind_of_definition(f"ENU:{origin}", "x.xml")


@pytest.mark.parametrize("name", ["bentley", "pix4d_external"])
def test_the_calibration_of_the_mounting_reads_them(tmp_path: Path, name: str) -> None:
    """Oracle: the same poses in the axes of a plane, to the digits of the file."""
    write, where, _, _ = CASES[name]
    eo = framed(block(), where)
    got = read_camera_poses(write(eo, tmp_path))
    assert got.plane is not None
    lat, lon, h = got.plane.geodetic_from_position(got.position)
    assert np.abs(np.column_stack([lat, lon]) - eo.geodetic[:, :2]).max() < 1e-10
    assert np.abs(h - eo.geodetic[:, 2]).max() < 1e-3


def test_a_reference_table_without_angles_holds_positions(tmp_path: Path) -> None:
    """Oracle: what is written; X_acc are metres, of positions that `insgnss adjust` weighs."""
    head = "#Label,X/Longitude,Y/Latitude,Z/Altitude,X_acc,Y_acc,Z_acc\n"
    row = "IMG_1.jpg,6.54,46.57,630.0,0.02,0.03,0.04\n"
    (tmp_path / "reference.csv").write_text(head + row)
    returned = read_returned_poses(tmp_path / "reference.csv", "metashape_reference")
    assert returned.C is None
    assert returned.position.tolist() == [[6.54, 46.57, 630.0]]
    assert returned.cov_position is not None
    assert np.sqrt(np.diagonal(returned.cov_position[0])) == pytest.approx([0.02, 0.03, 0.04])
    poses = read_poses(tmp_path / "reference.csv", hints=Hints(crs="EPSG:4326"))
    assert poses.C_Ex is None
    assert np.degrees([poses.lat[0], poses.lon[0]]) == pytest.approx([46.57, 6.54])
    with pytest.raises(InputError, match="has positions and no attitudes"):
        read_camera_poses(tmp_path / "reference.csv", Hints(crs="EPSG:4326"))


def test_positions_for_metashape_name_their_crs(tmp_path: Path) -> None:
    """Oracle: what `insgnss export` writes of positions without an IMU, in a CRS."""
    head = "#Label,Easting (EPSG:2056 CH1903+ / LV95; heights above the ellipsoid),Northing,Height,"
    row = "IMG_1.jpg,2531106.0,1158031.0,630.0,0.02,0.03,0.04\n"
    (tmp_path / "a.csv").write_text(f"{head}X_acc,Y_acc,Z_acc\n{row}")
    returned = read_returned_poses(tmp_path / "a.csv", "metashape_reference")
    assert (returned.kind, returned.crs) == ("projected", "EPSG:2056")
    assert returned.position.tolist() == [[2531106.0, 1158031.0, 630.0]]
    assert read_poses(tmp_path / "a.csv").cov_position is not None
