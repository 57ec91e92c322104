"""Tags in copies of images: read by Pillow and by the standard library's XML, and by exiv2 where it
is installed; pixels stay.
"""

import json
import re
import shutil
import struct
import subprocess
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ba_scene import Array, D, Place, assert_reprojects, block, exterior, framed, worked
from draws import normal_draws
from format_pages import on_page, without_version
from numpy.testing import assert_allclose
from oracles import oracle
from scipy.spatial.transform import Rotation

from insgnss.base.errors import DataError, InputError, UsageError
from insgnss.io.formats.images.image_tags import write_image_tags
from insgnss.io.formats.images.jpeg import with_tags
from insgnss.io.formats.images.xmp import set_properties
from insgnss.records import FramedOrientation

Image = pytest.importorskip(
    "PIL.Image", reason="Pillow is not installed: tags of images were not tested"
)
IFDRational = pytest.importorskip("PIL.TiffImagePlugin").IFDRational

NAMES = ("8001.tif", "8002.jpg", "8003.JPG")
URIS = {
    "http://pix4d.com/camera/1.0": "Camera",
    "http://www.dji.com/drone-dji/1.0/": "dji",
    "urn:insgnss:exterior-orientation:1.0#": "own",
}
OLD_XMP = (
    b'<?xpacket begin="" id="W5M0MpCehiHzreSzNTczkc9d"?><x:xmpmeta'
    b' xmlns:x="adobe:ns:meta/"><rdf:RDF'
    b' xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"><rdf:Description rdf:about="DJI Meta'
    b' Data" xmlns:drone-dji="http://www.dji.com/drone-dji/1.0/"'
    b' xmlns:exif="http://ns.adobe.com/exif/1.0/" xmlns:tiff="http://ns.adobe.com/tiff/1.0/"'
    b' drone-dji:GimbalYawDegree="+1.00" drone-dji:RelativeAltitude="+30.00" drone-dji:RtkFlag="16"'
    b' exif:GPSAltitude="1/1"'
    b' tiff:Make="M&amp;M"><drone-dji:GimbalRollDegree>3</drone-dji:GimbalRollDegree>'
    b"</rdf:Description></rdf:RDF></x:xmpmeta><?xpacket"
    b" end='w'?>"
)


def pixels() -> Array:
    return np.random.default_rng(0).integers(0, 255, (24, 32, 3), dtype=np.uint8)


def old_exif(version: bytes = b"0231") -> bytes:
    exif = Image.Exif()
    exif[0x010F] = "Maker"
    exif[0x8769] = {
        0x9000: version,
        0x829A: IFDRational(1, 100),
        0x927C: b"maker's note of many bytes",
    }
    exif[0x8825] = {1: "S", 2: (1.0, 2.0, 3.0), 13: 3.0}
    data: bytes = exif.tobytes()
    return data


@pytest.fixture
def photos(tmp_path: Path) -> Path:
    """A TIFF, a JPEG with Exif and XMP, a JPEG with neither."""
    folder = tmp_path / "photos"
    folder.mkdir()
    Image.fromarray(pixels()).save(folder / NAMES[0])
    Image.fromarray(pixels()).save(folder / NAMES[1], exif=old_exif(), xmp=OLD_XMP)
    Image.fromarray(pixels()).save(folder / NAMES[2])
    return folder


def flight(where: str = "EPSG:32632") -> FramedOrientation:
    return replace(framed(block(), where), images=NAMES)


def tags(path: Path) -> tuple[dict[int, Any], dict[int, Any], dict[str, str]]:
    """GPS and Exif directories as Pillow reads them, and the properties of the XMP packet,
    attributes or elements.
    """
    with Image.open(path) as image:
        exif = image.getexif()
        gps, own = dict(exif.get_ifd(0x8825)), dict(exif.get_ifd(0x8769))
        raw = image.info["xmp"] if "xmp" in image.info else image.tag_v2[700]
    properties: dict[str, str] = {}
    for element in ET.fromstring(raw.decode().strip()).iter():
        for key, value in [*element.attrib.items(), (element.tag, element.text or "")]:
            uri, _, name = key.removeprefix("{").partition("}")
            if uri in URIS:
                assert f"{URIS[uri]}:{name}" not in properties
                properties[f"{URIS[uri]}:{name}"] = value
    return gps, own, properties


def degrees(gps: dict[int, Any], tag: int, negative: str) -> float:
    d, m, s = (float(v) for v in gps[tag])
    return (d + m / 60 + s / 3600) * (-1 if gps[tag - 1] == negative else 1)


@pytest.mark.parametrize("where", ["tangent plane", "geographic", "EPSG:2056", "EPSG:32632"])
def test_tags_reproject(photos: Path, tmp_path: Path, where: str) -> None:
    """Oracle: Exif's degrees, minutes, seconds and height; Pix4D's Rz(-yaw) Rx(pitch) Ry(roll);
    0.03 mm and a micro-degree.
    """
    eo = replace(block(), images=NAMES)
    write_image_tags(flight(where), tmp_path / "out", images=photos)
    read = []
    for name in NAMES:
        gps, _, xmp = tags(tmp_path / "out" / name)
        place = Place(
            "geographic", np.array([degrees(gps, 4, "W"), degrees(gps, 2, "S"), float(gps[6])])
        )
        yaw, pitch, roll = (float(xmp[f"Camera:{angle}"]) for angle in ("Yaw", "Pitch", "Roll"))
        read.append(
            (
                place,
                Rotation.from_euler("ZXY", [-yaw, pitch, roll], degrees=True).as_matrix() @ D,
                True,
            )
        )
        assert_allclose(float(gps[17]), yaw, rtol=0, atol=1e-6)
    assert_reprojects(eo, read)


def test_pixels_and_everything_else_stay(photos: Path, tmp_path: Path) -> None:
    """Oracle: Pillow's pixels, the originals byte by byte, tags that are none of ours."""
    before = {path.name: path.read_bytes() for path in photos.iterdir()}
    write_image_tags(flight(), tmp_path / "out", images=photos)
    assert {path.name: path.read_bytes() for path in photos.iterdir()} == before
    assert {path.name for path in (tmp_path / "out").iterdir()} == set(NAMES)
    for name in NAMES:
        with Image.open(photos / name) as old, Image.open(tmp_path / "out" / name) as new:
            assert (np.asarray(old) == np.asarray(new)).all()
    gps, exif, xmp = tags(tmp_path / "out" / NAMES[1])
    assert float(gps[13]) == 3.0
    assert exif[0x927C] == b"maker's note of many bytes"
    assert float(exif[0x829A]) == 0.01
    assert xmp["dji:RelativeAltitude"] == "+30.00"
    packet = re.search(
        rb"<x:xmpmeta.*</x:xmpmeta>", (tmp_path / "out" / NAMES[1]).read_bytes(), re.DOTALL
    )
    assert packet is not None
    assert b'tiff:Make="M&amp;M"' in packet[0]
    assert b"exif:GPSAltitude" not in packet[0]  # the old height beside the new one
    assert packet[0].count(b'rdf:about="DJI Meta Data"') == 2
    assert "dji:RtkFlag" not in xmp


def test_time_is_utc(photos: Path, tmp_path: Path) -> None:
    """Oracle: GPS week 2008, 199 800 s are 2018-07-03 07:30:00 GPST, 18 s before in UTC; across
    midnight the date goes along.
    """
    write_image_tags(flight(), tmp_path / "out", images=photos)
    gps, _, _ = tags(tmp_path / "out" / NAMES[0])
    assert [float(v) for v in gps[7]] == [7.0, 29.0, 42.0]
    assert gps[29] == "2018:07:03"
    late = flight()
    object.__setattr__(
        late, "time", 172_800.0 + np.array([17.25, 18.0, 30.0])
    )  # Tuesday 00:00:17.25 GPST is Monday in UTC
    write_image_tags(late, tmp_path / "late", images=photos)
    gps, _, _ = tags(tmp_path / "late" / NAMES[0])
    assert ([float(v) for v in gps[7]], gps[29]) == ([23.0, 59.0, 59.25], "2018:07:02")
    assert tags(tmp_path / "late" / NAMES[1])[0][29] == "2018:07:03"


def test_ellipsoidal_heights_go_with_exif_3(photos: Path, tmp_path: Path) -> None:
    """Oracle: Exif 3.0, 4.6.7: GPSAltitudeRef 0 above, 1 below ellipsoid; GPSVersionID 2.4.0.0."""
    eo = flight()
    low = eo.geodetic.copy()
    low[2, 2] = -3.25
    eo = replace(eo, geodetic=low)
    write_image_tags(eo, tmp_path / "out", images=photos)
    for k, name in enumerate(NAMES):
        gps, exif, xmp = tags(tmp_path / "out" / name)
        assert (gps[0], exif[0x9000]) == (b"\x02\x04\x00\x00", b"0300")
        assert ord(gps[5]) == int(k == 2)
        assert float(gps[6]) == pytest.approx(abs(eo.geodetic[k, 2]), abs=0.51e-4)
        assert xmp["own:Heights"] == "above the ellipsoid of WGS84"
    assert float(tags(tmp_path / "out" / NAMES[2])[2]["dji:AbsoluteAltitude"]) == -3.25


def test_the_datum_of_the_positions(photos: Path, tmp_path: Path) -> None:
    """Oracle: the names of the frame."""
    eo = flight()
    frame = replace(eo.frame, datum="EPSG:6319", datum_name="NAD83(2011)")
    for of, horizontal, datum in ((eo.frame, "EPSG:4326", "WGS-84"), (frame, "EPSG:6319", None)):
        out = tmp_path / horizontal[5:]
        write_image_tags(replace(eo, frame=of), out, images=photos)
        gps, _, xmp = tags(out / NAMES[0])
        assert gps[18] == (datum or "NAD83(2011)")
        assert xmp["Camera:HorizCS"] == horizontal


@pytest.mark.parametrize(
    ("version", "reference", "gps_version"), [(b"0231", 0, 3), (b"0300", 2, 4), (None, 0, 3)]
)
def test_heights_above_sea_level(
    tmp_path: Path, version: bytes | None, reference: int, gps_version: int
) -> None:
    """Oracle: up to Exif 2.32, 0 is above sea level; in Exif 3.0, 2 is; the geoid's 49.6 m."""
    folder = tmp_path / "photos"
    folder.mkdir()
    options = {} if version is None else {"exif": old_exif(version)}
    Image.fromarray(pixels()).save(folder / "8001.jpg", **options)
    eo = replace(
        framed(exterior(block().C_mc[:1], block().position_m[:1]), "geographic"),
        images=("8001.jpg",),
    )
    write_image_tags(eo, tmp_path / "out", images=folder, heights="sea level", undulation_m=49.6)
    gps, exif, xmp = tags(tmp_path / "out" / "8001.jpg")
    assert ord(gps[5]) == reference
    assert gps[0][1] == gps_version
    assert exif[0x9000] == (version or b"0232")
    assert float(gps[6]) == pytest.approx(eo.geodetic[0, 2] - 49.6, abs=0.51e-4)
    assert xmp["own:Heights"] == "above mean sea level"
    with pytest.raises(UsageError, match="give the geoid's heights above the ellipsoid"):
        write_image_tags(eo, tmp_path / "x", images=folder, heights="sea level")
    with pytest.raises(
        UsageError, match="heights 'ellipsoid': give 'ellipsoid', or 'sea level' and"
    ):
        write_image_tags(eo, tmp_path / "x", images=folder, undulation_m=49.6)


def test_accuracies(photos: Path, tmp_path: Path) -> None:
    """Oracle: east, north, up of the geographic frame; Monte Carlo of the angles through scipy
    (4000 draws).
    """
    eo = flight("geographic")
    write_image_tags(eo, tmp_path / "out", images=photos, rtk_flag=50)
    gps, _, xmp = tags(tmp_path / "out" / NAMES[1])
    east, north, up = np.sqrt(np.diag(eo.cov[1]))[:3]
    got = [float(xmp[f"dji:RtkStd{axis}"]) for axis in ("Lon", "Lat", "Hgt")] + [
        float(xmp["Camera:GPSZAccuracy"])
    ]
    assert_allclose(got, [east, north, up, up], atol=0.51e-5)
    plan = np.sqrt((east**2 + north**2) / 2)
    assert_allclose(
        [float(xmp["Camera:GPSXYAccuracy"]), float(gps[31])], [plan, plan], atol=0.51e-5
    )
    assert xmp["dji:RtkFlag"] == "50"
    psi = normal_draws(eo.cov[1, 3:, 3:], 4000, seed=3)
    ypr = (Rotation.from_rotvec(psi) * Rotation.from_matrix(eo.C_fc[1] @ D)).as_euler(
        "ZXY", degrees=True
    )
    got = [float(xmp[f"Camera:IMU{angle}Accuracy"]) for angle in ("Yaw", "Pitch", "Roll")]
    assert_allclose(got, np.std(np.unwrap(ypr, axis=0, period=360), axis=0, ddof=1), rtol=0.003)


def test_gimbal_exact(photos: Path, tmp_path: Path) -> None:
    """Oracle: DJI's definition by scipy: north east down, Z-Y-X, of view, right, down; formats.md
    B10 for (47, 1, 2).
    """
    eo = flight("geographic")
    write_image_tags(eo, tmp_path / "out", images=photos, gimbal="exact")
    S = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])
    for k, name in enumerate(NAMES):
        _, exif, xmp = tags(tmp_path / "out" / name)
        R = Rotation.from_euler(
            "ZYX",
            [float(xmp[f"dji:Gimbal{a}Degree"]) for a in ("Yaw", "Pitch", "Roll")],
            degrees=True,
        ).as_matrix()
        assert_allclose(
            S @ R @ np.eye(3)[:, [1, 2, 0]], eo.C_fc[k], atol=1e-7
        )  # columns of the camera: right, down, view
        assert float(exif[0x9405]) == pytest.approx(
            np.degrees(np.arcsin(eo.C_fc[k, 2, 2])), abs=1e-6
        )
    C = Rotation.from_euler("ZXY", [-47, 1, 2], degrees=True).as_matrix() @ D
    one = replace(
        framed(exterior(C[None], np.array([[0.0, 0, 200]])), "geographic"), images=(NAMES[0],)
    )
    write_image_tags(one, tmp_path / "one", images=photos, gimbal="exact", missing="skip")
    _, _, xmp = tags(tmp_path / "one" / NAMES[0])
    assert_allclose(
        [float(xmp[f"dji:Gimbal{a}Degree"]) for a in ("Yaw", "Pitch", "Roll")],
        [-16.4, -87.8, 63.4],
        atol=0.05,
    )


def test_gimbal_nadir_and_none(photos: Path, tmp_path: Path) -> None:
    """Oracle: formats.md B10: the yaw of the image's top, -90, 0; a camera that looks 60 deg off
    the nadir has no such angles.
    """
    write_image_tags(flight(), tmp_path / "out", images=photos, gimbal="nadir")
    for name in NAMES:
        _, _, xmp = tags(tmp_path / "out" / name)
        assert (float(xmp["dji:GimbalPitchDegree"]), float(xmp["dji:GimbalRollDegree"])) == (
            -90.0,
            0.0,
        )
        assert -180.0 <= float(xmp["dji:GimbalYawDegree"]) < 180.0
        assert (
            float(xmp["dji:GimbalYawDegree"]) - float(xmp["Camera:Yaw"])
        ) % 360 == pytest.approx(0.0, abs=1e-6)
        assert xmp["own:GimbalAngles"].startswith("nadir")
    C = Rotation.from_euler("ZXY", [-47, 60, 2], degrees=True).as_matrix() @ D
    oblique = replace(
        framed(exterior(C[None], np.array([[0.0, 0, 200]])), "geographic"), images=(NAMES[1],)
    )
    with pytest.raises(
        DataError, match=r"image 8002.jpg: looks 60\.0 deg off the nadir \(limit 45 deg"
    ):
        write_image_tags(oblique, tmp_path / "x", images=photos, missing="skip", gimbal="nadir")
    write_image_tags(oblique, tmp_path / "none", images=photos, missing="skip", gimbal="none")
    assert not any(
        "Gimbal" in name for name in tags(tmp_path / "none" / NAMES[1])[2] if name.startswith("dji")
    )


def _as_opendronemap(xmp: dict[str, str]) -> np.ndarray:
    """Attitude (right, down, view) in east, north, up of opendm/photo.py for a camera of DJI."""
    y, p, r = (float(xmp[f"dji:Gimbal{name}Degree"]) for name in ("Yaw", "Pitch", "Roll"))
    C_nb = Rotation.from_euler("ZYX", [y, p + 90.0, r], degrees=True).as_matrix()
    S = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])
    return S @ C_nb @ np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])


@pytest.mark.parametrize(
    ("ypr", "looks_down", "error_deg"),
    [
        ((30.0, 2.0, -3.0), True, 3.7),
        ((120.0, -1.0, 1.5), True, 1.9),
        ((80.0, 60.0, 0.0), False, 0.01),
        ((200.0, 25.0, 0.0), False, 0.01),
        ((200.0, -25.0, 0.0), True, 25.1),
        ((310.0, 0.0, 0.0), True, 0.01),
    ],
)
def test_each_image_has_the_angles_that_readers_take_rightly(
    tmp_path: Path, ypr: tuple[float, ...], looks_down: bool, error_deg: float
) -> None:
    """Oracle: OpenDroneMap's attitude by scipy differs by the tilt that -90 leaves out, by nothing
    for an image pitched forward; an oblique image among them changes nothing.
    """
    folder, exif = tmp_path / "photos", Image.Exif()
    folder.mkdir()
    exif[0x010F] = "DJI"
    angles = [ypr, (10.0, 60.0, 0.0)]
    for name in ("1.jpg", "2.jpg"):
        Image.fromarray(pixels()).save(folder / name, exif=exif)
    C = np.array(
        [Rotation.from_euler("ZXY", [-y, p, r], degrees=True).as_matrix() @ D for y, p, r in angles]
    )
    eo = framed(exterior(C, np.array([[0.0, 0, 200], [5.0, 0, 200]])), "geographic")
    write_image_tags(replace(eo, images=("1.jpg", "2.jpg")), tmp_path / "out", images=folder)
    for k, (down, most) in enumerate(((looks_down, error_deg), (False, 0.01))):
        xmp = tags(tmp_path / "out" / f"{k + 1}.jpg")[2]
        pitch, roll = (float(xmp[f"dji:Gimbal{name}Degree"]) for name in ("Pitch", "Roll"))
        assert ((pitch, roll) == (-90.0, 0.0)) == down
        turn = Rotation.from_matrix(_as_opendronemap(xmp).T @ C[k]).magnitude()
        assert np.degrees(turn) < most


@pytest.mark.parametrize("tilt_rad", [0.0, 1e-13, 1e-11, 1e-8, 1e-6])
def test_exact_angles_at_the_nadir(photos: Path, tmp_path: Path, tilt_rad: float) -> None:
    """Oracle: yaw plus roll is the azimuth of the image's top, 47 deg, where yaw alone is none."""
    C = Rotation.from_euler("ZXY", [-np.radians(47), tilt_rad, -0.3 * tilt_rad]).as_matrix() @ D
    one = framed(exterior(C[None], np.array([[0.0, 0, 200]])), "geographic")
    one = replace(one, images=(NAMES[0],))
    write_image_tags(one, tmp_path / "one", images=photos, gimbal="exact", missing="skip")
    xmp = tags(tmp_path / "one" / NAMES[0])[2]
    yaw, pitch, roll = (float(xmp[f"dji:Gimbal{a}Degree"]) for a in ("Yaw", "Pitch", "Roll"))
    assert (yaw + roll) % 360.0 == pytest.approx(47.0, abs=2e-6)
    assert pitch == pytest.approx(-90.0, abs=1e-4)


@pytest.mark.parametrize(
    ("maker", "written"), [("DJI", True), ("Hasselblad", True), ("SONY", False), (None, False)]
)
@pytest.mark.parametrize("tilt", [0.0, 60.0])
def test_angles_of_a_gimbal_where_their_reader_expects_them(
    tmp_path: Path, maker: str | None, written: bool, tilt: float
) -> None:
    """Oracle: OpenDroneMap's rule (opendm/photo.py): pitch from the gimbal before that of Camera,
    and 90 deg more of DJI and Hasselblad; it comes out as the angle from the nadir.
    """
    folder = tmp_path / "photos"
    folder.mkdir()
    exif = Image.Exif()
    if maker is not None:
        exif[0x010F] = maker
    Image.fromarray(pixels()).save(folder / "1.jpg", exif=exif, xmp=OLD_XMP)
    Image.fromarray(pixels()).save(folder / "2.tif", exif=exif)
    C = Rotation.from_euler("ZXY", [-47, tilt, 0], degrees=True).as_matrix() @ D
    eo = framed(exterior(np.array([C, C]), np.array([[0.0, 0, 200], [5.0, 0, 200]])), "geographic")
    eo = replace(eo, images=("1.jpg", "2.tif"))
    write_image_tags(eo, tmp_path / "out", images=folder)
    for name in eo.images:
        _, _, xmp = tags(tmp_path / "out" / name)
        assert ("dji:GimbalPitchDegree" in xmp) == ("dji:GimbalRollDegree" in xmp) == written
        pitch = float(xmp.get("dji:GimbalPitchDegree", xmp["Camera:Pitch"]))
        pitch += 90.0 if maker in ("DJI", "Hasselblad") else 0.0
        assert pitch == pytest.approx(tilt, abs=1e-4)  # the vertical turns by 5e-5 in 5 m


def test_as_exiv2_reads_it(photos: Path, tmp_path: Path) -> None:
    """Oracle: exiv2."""
    pyexiv2 = oracle("pyexiv2")
    write_image_tags(flight(), tmp_path / "out", images=photos)
    for name in NAMES:
        with pyexiv2.Image(str(tmp_path / "out" / name)) as image:
            exif, xmp = image.read_exif(), image.read_xmp()
        assert exif["Exif.GPSInfo.GPSMapDatum"] == "WGS-84"
        assert exif["Exif.GPSInfo.GPSLatitudeRef"] == "N"
        assert float(xmp["Xmp.Camera.Pitch"]) == float(
            tags(tmp_path / "out" / name)[2]["Camera:Pitch"]
        )


@pytest.mark.parametrize(("order", "big"), [("<", False), (">", False), ("<", True), (">", True)])
def test_tiff_of_any_order_and_size(tmp_path: Path, order: str, big: bool) -> None:
    """Oracle: a TIFF of two pages written here by struct; each page's pixels and the second page's
    place after the first.
    """
    folder = tmp_path / "photos"
    folder.mkdir()
    (folder / "8001.tiff").write_bytes(two_pages(order, big))
    eo = replace(
        framed(exterior(block().C_mc[:1], block().position_m[:1]), "geographic"), images=("8001",)
    )
    write_image_tags(eo, tmp_path / "out", images=folder)
    written = (tmp_path / "out" / "8001.tiff").read_bytes()
    head = 16 if big else 8
    assert written[head : len(two_pages(order, big))] == two_pages(order, big)[head:]
    first, following = directory(written, order, big, None)
    old_first, old_following = directory(two_pages(order, big), order, big, None)
    assert following == old_following
    assert {tag: first[tag] for tag in old_first} == old_first
    gps, _ = directory(
        written, order, big, struct.unpack(order + ("Q" if big else "I"), first[0x8825])[0]
    )
    at = struct.unpack(order + ("Q" if big else "I"), gps[2])[0]
    d, d1, m, m1, sec, sec1 = struct.unpack_from(order + "6I", written, at)
    assert d / d1 + m / m1 / 60 + sec / sec1 / 3600 == pytest.approx(
        np.degrees(eo.geodetic[0, 0]), abs=1e-9
    )
    if order == ">" and big:
        return  # Pillow reads no BigTIFF of this order
    with Image.open(tmp_path / "out" / "8001.tiff") as image:
        assert image.n_frames == 2
        page = np.asarray(image)
        image.seek(1)
        assert_allclose(np.asarray(image).ravel(), [5, 6, 7, 8])
        assert_allclose(page.ravel(), [1, 2, 3, 4])
    assert "Camera:Yaw" in tags(tmp_path / "out" / "8001.tiff")[2]


def directory(data: bytes, order: str, big: bool, at: int | None) -> tuple[dict[int, bytes], int]:
    """Value fields of a directory by tag (the first one for None), which TIFF wants in rising
    order, and the next one's offset.
    """
    word, count, size = ("Q", "Q", 8) if big else ("I", "H", 4)
    if at is None:
        (at,) = struct.unpack_from(order + word, data, 8 if big else 4)
    (n,) = struct.unpack_from(order + count, data, at)
    at += struct.calcsize(order + count)
    fields: dict[int, bytes] = {}
    for _ in range(n):
        (tag,) = struct.unpack_from(order + "H", data, at)
        assert tag > max(fields, default=-1)
        at += 4 + 2 * size
        fields[tag] = data[at - size : at]
    return fields, struct.unpack_from(order + word, data, at)[0]


def two_pages(order: str, big: bool) -> bytes:
    """Two grey images of 2 x 2 pixels, one strip each."""
    word = "Q" if big else "I"
    body = (b"II" if order == "<" else b"MM") + struct.pack(
        order + ("HHHQ" if big else "HI"), *((43, 8, 0, 24) if big else (42, 16))
    )
    body += bytes([1, 2, 3, 4, 5, 6, 7, 8])
    at = len(body) - 8
    for page in (0, 1):
        entries = [
            (256, 3, 2),
            (257, 3, 2),
            (258, 3, 8),
            (259, 3, 1),
            (262, 3, 1),
            (273, 4, at + 4 * page),
            (278, 3, 2),
            (279, 4, 4),
        ]
        body += struct.pack(order + ("Q" if big else "H"), len(entries))
        for tag, kind, value in entries:
            field = struct.pack(order + ("H" if kind == 3 else "I"), value).ljust(
                8 if big else 4, b"\x00"
            )
            body += struct.pack(f"{order}HH{word}", tag, kind, 1) + field
        size = struct.calcsize(f"{order}{word}")
        body += struct.pack(order + word, len(body) + size if page == 0 else 0)
    return body


def test_images_and_orientations_that_do_not_match(photos: Path, tmp_path: Path) -> None:
    """Oracle: the directory: one image more, one less; copies of those that match by option."""
    eo = replace(flight(), images=("8001.tif", "8002.jpg", "9009.jpg"))
    with pytest.raises(
        InputError,
        match=r"has no image '9009\.jpg' \(1 of 3 orientations lack their image\).*--set"
        " missing=skip",
    ):
        write_image_tags(eo, tmp_path / "out", images=photos)
    fewer = replace(
        framed(exterior(block().C_mc[:2], block().position_m[:2]), "geographic"), images=NAMES[:2]
    )
    with pytest.raises(
        InputError, match=r"8003\.JPG has no orientation \(1 of 3 images lack an orientation\)"
    ):
        write_image_tags(fewer, tmp_path / "out", images=photos)
    assert not (tmp_path / "out").exists()
    write_image_tags(eo, tmp_path / "out", images=photos, missing="skip")
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"8001.tif", "8002.jpg"}
    with pytest.raises(
        InputError, match="none of its 3 images is one of the 3 orientations; is it another flight"
    ):
        write_image_tags(
            replace(eo, images=("1.tif", "2.tif", "3.tif")),
            tmp_path / "x",
            images=photos,
            missing="skip",
        )
    (photos / "8001.jpg").write_bytes((photos / "8002.jpg").read_bytes())
    with pytest.raises(InputError, match=r"8001\.jpg and 8001\.tif could both be image '8001'"):
        write_image_tags(
            replace(eo, images=("8001", "8002.jpg", "8003.JPG")), tmp_path / "x", images=photos
        )


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"images": None}, "give the directory where they are"),
        ({"missing": "guess"}, "missing 'guess' is none of refuse, skip"),
        ({"gimbal": "yes"}, "gimbal 'yes' is none of auto, none, nadir, exact"),
        ({"rtk_flag": 3}, "rtk_flag 3 is none of 0"),
        ({"heights": "geoid"}, "heights 'geoid': give 'ellipsoid'"),
        ({"form": "csv"}, "form 'csv' is none of copies, exiftool"),
    ],
)
def test_wrong_options(photos: Path, tmp_path: Path, options: dict[str, Any], message: str) -> None:
    """Oracle: the options' words."""
    with pytest.raises(UsageError, match=message):
        write_image_tags(flight(), tmp_path / "x", **({"images": photos} | options))
    assert not (tmp_path / "x").exists()


def test_never_in_place(photos: Path, tmp_path: Path) -> None:
    """Oracle: the images' own directory, and a link that leads there."""
    before = {path.name: path.read_bytes() for path in photos.iterdir()}
    (tmp_path / "link").symlink_to(photos)
    for directory in (photos, tmp_path / "link"):
        with pytest.raises(UsageError, match="holds the images themselves, which are not touched"):
            write_image_tags(flight(), directory, images=photos)
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / NAMES[0]).symlink_to(photos / NAMES[0])
    with pytest.raises(UsageError, match="is the image itself"):
        write_image_tags(flight(), tmp_path / "out", images=photos)
    with pytest.raises(UsageError, match="is no directory"):
        write_image_tags(flight(), tmp_path / "out", images=tmp_path / "nowhere")
    assert {path.name: path.read_bytes() for path in photos.iterdir()} == before


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"\x89PNG\r\n", "is neither JPEG nor TIFF"),
        (b"\xff\xd8\xff\xe1\x40\x00Exif", "no JPEG from byte 2 of 10 on; it was cut off"),
        (b"II\x2a\x00\x40\x00\x00\x00", "refers to byte 66, but the file ends at byte 8"),
        (b"II\x2b\x00\x08\x00", "is no TIFF"),
        (b"II\x2a\x00\x08\x00\x00\x00\xff\xff", "claims 65535 tags"),
    ],
)
def test_broken_images(photos: Path, tmp_path: Path, content: bytes, message: str) -> None:
    """Oracle: headers cut or led astray by hand, of the last image; nothing is left behind."""
    (photos / NAMES[-1]).write_bytes(content)
    with pytest.raises(InputError, match=message) as refusal:
        write_image_tags(flight(), tmp_path / "out", images=photos)
    assert NAMES[-1] in str(refusal.value)
    assert sorted(tmp_path.iterdir()) == [photos]


def test_segments_of_a_jpeg() -> None:
    """Oracle: by hand: JFIF first, fill bytes, a segment that is too long for its two bytes, two of
    the same.
    """
    jfif, comment, scan = b"\xff\xe0\x00\x04ab", b"\xff\xfe\x00\x03c", b"\xff\xda\x00\x02pixels"

    def head(data: bytes, exif: bytes = b"E", xmp: bytes = b"X") -> tuple[bytes, int]:
        return with_tags(
            lambda at, n: data[at : at + n], len(data), "a.jpg", lambda old: exif, lambda old: xmp
        )

    made, rest = head(b"\xff\xd8" + jfif + comment + scan)
    assert (
        made
        == b"\xff\xd8"
        + jfif
        + b"\xff\xe1\x00\x09Exif\x00\x00E\xff\xe1\x00\x20http://ns.adobe.com/xap/1.0/\x00X"
        + comment
    )
    assert rest == 2 + len(jfif) + len(comment)
    again, _ = head(made + b"\xff" + scan, b"EE")  # 0xFF may be repeated before a marker
    assert again.count(b"Exif") == 1
    assert b"Exif\x00\x00EE" in again
    several, old = b"\xff\xe2\x00\x06MPF\x00", b"\xff\xe1\x00\x20http://ns.adobe.com/xap/1.0/\x00o"
    made, _ = head(
        b"\xff\xd8" + jfif + several + old + scan
    )  # what grows must stand before what counts from its own place
    assert made.endswith(b"\x00X" + several)
    with pytest.raises(
        InputError, match=r"a\.jpg: its Exif would need 65542 bytes \(limit 65533\)"
    ):
        head(b"\xff\xd8" + scan, exif=bytes(65536))
    twice = b"\xff\xe1\x00\x08Exif\x00\x00"
    with pytest.raises(InputError, match="has 2 segments of Exif"):
        head(b"\xff\xd8" + twice + twice + scan)


@pytest.mark.parametrize(
    ("packet", "message"),
    [
        (b"<x:xmpmeta>", "is not well formed"),
        (b"\xff\xfe<", "is no UTF-8"),
        (b'<!DOCTYPE a [<!ENTITY b "c">]><x/>', "declares a document type"),
    ],
)
def test_broken_packets(packet: bytes, message: str) -> None:
    """Oracle: XML by hand."""
    with pytest.raises(InputError, match=message):
        set_properties(packet, {("own", "urn:a#"): {"B": "c"}}, {}, "a.jpg")


def test_packet_of_other_prefixes() -> None:
    """Oracle: namespaces by ElementTree: another prefix for ours, ours for a sibling with a slash,
    an RDF without content.
    """
    old = b"""<r:RDF xmlns:r="http://www.w3.org/1999/02/22-rdf-syntax-ns#"><r:Description r:about=''
      xmlns:p='urn:a#' xmlns:own='urn:a#/' p:B='1' own:B="2"><p:C>3</p:C></r:Description></r:RDF>"""
    got = ET.fromstring(
        set_properties(old, {("own", "urn:a#"): {"B": '<"&'}}, {"urn:a#": ("C",)}, "a.jpg")
    )
    keys = [
        (key, value) for e in got.iter() for key, value in e.attrib.items() if "about" not in key
    ]
    assert keys == [("{urn:a#}B", '<"&')]
    assert not [e for e in got.iter() if e.tag == "{urn:a#}C"]
    empty = b'<r:RDF xmlns:r="http://www.w3.org/1999/02/22-rdf-syntax-ns#"/>'
    assert b'own:B="c"' in set_properties(empty, {("own", "urn:a#"): {"B": "c"}}, {}, "a.jpg")


def example(folder: Path) -> str:
    """What the page shows: the XMP packet of the worked example of formats.md 0.2."""
    (folder / "in").mkdir()
    Image.fromarray(pixels()).save(folder / "in" / "8001.tif")
    write_image_tags(worked("EPSG:2056"), folder / "out", images=folder / "in")
    with Image.open(folder / "out" / "8001.tif") as image:
        packet: bytes = image.tag_v2[700]
    return packet.decode().replace("\ufeff", "")


def test_the_page_shows_what_is_written(tmp_path: Path) -> None:
    """Oracle: data_specs, all but the version."""
    assert without_version(example(tmp_path)) == without_version(on_page("image_tags"))


def test_arguments_of_exiftool_are_the_tags_of_the_copies(photos: Path, tmp_path: Path) -> None:
    """Oracle: Pillow's reading of the copies; no copy beside the arguments, and the images stay."""
    before = {path.name: path.read_bytes() for path in photos.iterdir()}
    write_image_tags(flight(), tmp_path / "copies", images=photos, gimbal="exact")
    write_image_tags(flight(), tmp_path / "out", images=photos, gimbal="exact", form="exiftool")
    assert {path.name: path.read_bytes() for path in photos.iterdir()} == before
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "exiftool.args",
        "exiftool.config",
    ]
    config = (tmp_path / "out" / "exiftool.config").read_text()
    commands = (tmp_path / "out" / "exiftool.args").read_text().split("-execute\n")[:-1]
    assert [command.splitlines()[-1] for command in commands] == [f"./{name}" for name in NAMES]
    for name, command in zip(NAMES, commands, strict=True):
        gps, exif, xmp = tags(tmp_path / "copies" / name)
        rows = (row[1:].split("=", 1) for row in command.splitlines()[:-3])
        values = {key.rstrip("#"): value for key, value in rows}
        xmp.pop("dji:RelativeAltitude", None)  # was in the image, and stays
        for key, value in xmp.items():
            prefix, _, property_name = key.partition(":")
            group = {"dji": "drone-dji", "own": "insgnss"}.get(prefix, prefix)
            assert values[f"XMP-{group}:{property_name}"] == value
            assert f"  {property_name} => {{}},\n" in config
        for tag, key in ((2, "GPSLatitude"), (4, "GPSLongitude"), (7, "GPSTimeStamp")):
            numbers = [float(number) for number in values[f"GPS:{key}"].split()]
            assert_allclose(numbers, [float(v) for v in gps[tag]], rtol=0.0, atol=1e-9)
        assert values["GPS:GPSVersionID"] == " ".join(map(str, gps[0]))
        assert float(values["GPS:GPSAltitude"]) == float(gps[6])
        assert (values["GPS:GPSLatitudeRef"], values["GPS:GPSDateStamp"]) == (gps[1], gps[29])
        assert values["ExifIFD:ExifVersion"] == exif[0x9000].decode()


@pytest.mark.slow
def test_exiftool_writes_what_the_copies_have(photos: Path, tmp_path: Path) -> None:
    """Oracle: ExifTool, which reads the copies and the images that it has tagged itself."""
    exiftool = shutil.which("exiftool")
    if exiftool is None:
        pytest.skip("exiftool is not installed: its arguments were not tried")

    def read(folder: Path) -> list[dict[str, Any]]:
        command = [exiftool, "-config", tmp_path / "out" / "exiftool.config", "-G1", "-n", "-json"]
        done = subprocess.run([*command, folder], capture_output=True, check=True, text=True)
        groups = ("GPS:", "XMP-Camera:", "XMP-drone-dji:", "XMP-insgnss:", "XMP-exif:")
        return [
            {key: value for key, value in image.items() if key.startswith(groups)}
            for image in sorted(json.loads(done.stdout), key=lambda image: image["SourceFile"])
        ]

    write_image_tags(flight(), tmp_path / "copies", images=photos, gimbal="exact")
    write_image_tags(flight(), tmp_path / "out", images=photos, gimbal="exact", form="exiftool")
    command = [exiftool, "-config", "../out/exiftool.config", "-@", "../out/exiftool.args"]
    done = subprocess.run(command, cwd=photos, capture_output=True, check=True, text=True)
    assert done.stderr == ""
    for path in photos.glob("*_original"):
        path.unlink()
    for written, copied in zip(read(photos), read(tmp_path / "copies"), strict=True):
        assert written == pytest.approx(copied, abs=1e-5)  # its rounding of rationals
