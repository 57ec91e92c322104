"""Which frame poses of other programs stand in: named, declared, recognised or asked for."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from ba_scene import D, block, enu_axes, framed
from block_scene import numbers
from pyproj import CRS, Transformer
from sites import orientation_at
from test_returned_poses import colmap, ign_opk, joined, metashape_opk_text, micmac, opk_deg

import insgnss
from insgnss.base.errors import InputError, UsageError
from insgnss.flight.config.block_file import BlockFile, GroundTableInput
from insgnss.geodesy.crs import crs_of
from insgnss.geodesy.frames import TangentPlane
from insgnss.geodesy.projection import MapProjection
from insgnss.io.formats.bundle.import_helpers import metashape_crs
from insgnss.navigation.orient.frame import in_frame
from insgnss.photogrammetry.block_adjustment.ground import ground_in_plane
from insgnss.photogrammetry.comparison.compare import compare_files
from insgnss.photogrammetry.comparison.hints import Hints
from insgnss.photogrammetry.mounting_calibration import in_flight
from insgnss.photogrammetry.mounting_calibration.in_flight import calibrate_mounting
from insgnss.photogrammetry.mounting_calibration.options import Assumptions, SimilarityOptions
from insgnss.photogrammetry.mounting_calibration.poses import read_camera_poses, refuse_distant
from insgnss.photogrammetry.mounting_calibration.similarity_files import calibrate_similarity
from insgnss.records import FramedOrientation

UTM_N, UTM_E = 5160000.0, 311000.0
SITE = """DERIVEDPROJCRS["site",BASEPROJCRS{base},DERIVINGCONVERSION["shift",METHOD["Affine
parametric transformation",ID["EPSG",9624]],PARAMETER["A0",-311000,LENGTHUNIT["metre",1],ID["EPSG",
8623]],PARAMETER["A1",1,SCALEUNIT["unity",1],ID["EPSG",8624]],PARAMETER["A2",0,SCALEUNIT["unity",1],
ID["EPSG",8625]],PARAMETER["B0",-5160000,LENGTHUNIT["metre",1],ID["EPSG",8639]],PARAMETER["B1",0,
SCALEUNIT["unity",1],ID["EPSG",8640]],PARAMETER["B2",1,SCALEUNIT["unity",1],ID["EPSG",8641]]],
CS[Cartesian,2],AXIS["(E)",east,ORDER[1],LENGTHUNIT["metre",1]],AXIS["(N)",north,ORDER[2],
LENGTHUNIT["metre",1]]]"""


def site_crs(path: Path, code: str = "EPSG:32632") -> str:
    """A file with a CRS whose coordinates are those of a zone less whole kilometres."""
    base = CRS(code).to_wkt("WKT2_2019").partition("PROJCRS")[2]
    text = SITE.replace("\n", " ").replace('"EPSG", 8', '"EPSG",8')
    (path / "site.wkt").write_text(text.replace("{base}", base.partition(",CS[")[0] + "]"))
    return str(path / "site.wkt")


def test_metashape_is_not_given_a_site_calibration(tmp_path: Path) -> None:
    """Oracle: well-known text of the first kind has no DERIVEDPROJCRS; its base is named."""
    crs = crs_of(site_crs(tmp_path))
    with pytest.raises(UsageError, match=r"site cannot be .*; export WGS 84 / UTM zone 32N"):
        metashape_crs("", crs.to_wkt())


def in_map(eo: insgnss.ExteriorOrientation, crs: str) -> FramedOrientation:
    """The poses in a projected CRS."""
    return in_frame(eo, "projected", MapProjection(crs))


def differ(eo: insgnss.ExteriorOrientation, path: Path, **frame: object) -> tuple[float, float]:
    """Largest differences of read poses from their truth, m and deg."""
    got, truth = insgnss.read_poses(path, **frame), framed(eo, "geographic")
    assert got.C_Ex is not None
    metres = (np.column_stack([got.lon, got.lat, got.height]) - truth.coordinates) * [4e6, 6e6, 1]
    turn = np.degrees(np.abs(got.C_Ex @ truth.C_Ec.swapaxes(1, 2) - np.eye(3)).max())
    return float(np.abs(metres).max()), float(turn)


@pytest.mark.parametrize("crs", ["EPSG:2154", "EPSG:32632", "EPSG:4978", "site"])
def test_a_declared_frame_is_never_guessed_over(tmp_path: Path, crs: str) -> None:
    """Oracle: the block; northings of Lambert-93 are as long as the Earth's radius."""
    eo = block()
    name = crs if crs != "site" else site_crs(tmp_path)
    if crs == "EPSG:4978":
        path = ign_opk(framed(eo, "geocentric"), tmp_path)
    else:
        at = in_map(eo, "EPSG:32632" if crs == "site" else crs)
        shift = np.array([UTM_E, UTM_N, 0.0]) if crs == "site" else 0.0
        path = ign_opk(replace(at, coordinates=at.coordinates - shift), tmp_path)
    metres, degrees = differ(eo, path, crs=name)
    assert metres < 1e-4
    assert degrees < 1e-4


def test_what_values_can_only_be_is_taken_and_said(tmp_path: Path) -> None:
    """Oracle: the block, in axes of the Earth and as longitude and latitude, deg."""
    eo = block()
    path = micmac(framed(eo, "geocentric"), tmp_path)
    assert max(differ(eo, path)) < 1e-4
    assert insgnss.read_poses(path).notes[-1].endswith("geocentric by their size")
    in_degrees = framed(eo, "geographic")
    text = ""
    for name, x, C in zip(eo.images, in_degrees.coordinates, in_degrees.C_Ec, strict=True):
        place = (*np.degrees(x[:2]), x[2])
        text += joined(name, *place, *opk_deg(C), *(C @ D).T.reshape(9), by="\t")
    (tmp_path / "opk.txt").write_text(f"# PhotoID, X, Y, Z, Omega, Phi, Kappa, r11\n{text}")
    assert max(differ(eo, tmp_path / "opk.txt")) < 1e-4
    assert "taken as longitude and latitude" in insgnss.read_poses(tmp_path / "opk.txt").notes[-1]
    assert max(differ(eo, tmp_path / "opk.txt", crs="EPSG:4326")) < 1e-4


def test_a_geographic_crs_of_another_datum_is_transformed(tmp_path: Path) -> None:
    """Oracle: pyproj: the same numbers in CH1903+ lie elsewhere by what its datum is shifted."""
    eo = block()
    x = framed(eo, "geographic").coordinates
    lon, lat, _ = Transformer.from_crs("EPSG:4979", "EPSG:4150", always_xy=True).transform(
        np.degrees(x[:, 0]), np.degrees(x[:, 1]), x[:, 2]
    )
    text = "".join(
        joined(name, a, b, h, 0.0, 0.0, 0.0, *np.eye(3).ravel(), by="\t")
        for name, a, b, h in zip(eo.images, lon, lat, x[:, 2], strict=True)
    )
    (tmp_path / "opk.txt").write_text(f"# PhotoID, X, Y, Z, Omega, Phi, Kappa, r11\n{text}")
    got = insgnss.read_poses(tmp_path / "opk.txt", crs="EPSG:4150")
    assert np.abs((np.column_stack([got.lon, got.lat]) - x[:, :2]) * 6e6).max() < 0.02
    assert np.abs(x[:, 1] - np.radians(lat)).max() * 6e6 > 100.0


def test_large_coordinates_without_a_crs_are_asked_for(tmp_path: Path) -> None:
    """Oracle: norms of 6.6e6 m in Lambert-93, whose points lie 300 km off as geocentric
    ones; geocentric feet; a northing at the equator, where that height would be one of a camera.
    """
    path = ign_opk(in_map(block(), "EPSG:2154"), tmp_path)
    for read in (insgnss.read_poses, read_camera_poses):
        with pytest.raises(InputError, match="does not say the CRS of its coordinates"):
            read(path)
    with pytest.raises(InputError, match="are of no tangent plane but of a CRS"):
        insgnss.read_poses(path, origin=(46.57, 6.54, 0.0))
    path = micmac(framed(block(), "geocentric"), tmp_path)
    for file in path.glob("Orientation-*"):  # in feet
        head, tail = file.read_text().split("<Centre>")
        x, tail = tail.split("</Centre>")
        feet = " ".join(repr(float(v) / 0.3048) for v in x.split())
        file.write_text(f"{head}<Centre>{feet}</Centre>{tail}")
    with pytest.raises(InputError, match="does not say the CRS of its coordinates"):
        insgnss.read_poses(path)
    text = "NOM X Y Z O P K CAMERA\na 300000 6371100 120 0 0 0 c\nb 300010 6371100 120 0 0 0 c\n"
    (tmp_path / "a.OPK").write_text(text)
    with pytest.raises(InputError, match="does not say the CRS of its coordinates"):
        insgnss.read_poses(tmp_path / "a.OPK")


def test_exchanged_coordinates_are_said_where_a_file_is_read(tmp_path: Path) -> None:
    """Oracle: the columns that were exchanged; the place is 140 deg off, and compare names it."""
    eo = in_map(block(), "EPSG:32632")
    exchanged = replace(eo, coordinates=eo.coordinates[:, [1, 0, 2]])
    (note,) = insgnss.read_poses(ign_opk(exchanged, tmp_path), crs="EPSG:32632").notes
    assert "with easting and northing exchanged they lie at 46.5" in note


def test_a_mounting_asks_before_the_flight_is_processed(tmp_path: Path) -> None:
    """Oracle: a flight of which nothing but its camera can be read."""
    path = ign_opk(in_map(block(), "EPSG:2154"), tmp_path)
    flight = SimpleNamespace(camera="a camera", path=tmp_path)
    with pytest.raises(InputError, match="does not say the CRS of its coordinates"):
        calibrate_mounting(flight, path)  # type: ignore[arg-type]


def test_a_site_in_another_zone_is_refused_by_each_verb(tmp_path: Path) -> None:
    """Oracle: the block, whose site stands in UTM 32, not 31: 460 km off; each verb takes the
    right one, and asks of the other by `refuse_distant` or as it does.
    """
    eo = block()
    at = in_map(eo, "EPSG:32632")
    coordinates = at.coordinates - [UTM_E, UTM_N, 0.0]
    path = ign_opk(replace(at, coordinates=coordinates), tmp_path)
    rows = [
        joined(n, *x, *[0.01] * 3, by=",")
        for n, x in zip(eo.images, coordinates.tolist(), strict=True)
    ]
    head = "name,x,y,z,sigma_x,sigma_y,sigma_z\n"
    (points := tmp_path / "points.csv").write_text(head + "".join(rows))
    lat, lon, h = TangentPlane(*eo.origin).geodetic_from_position(eo.position_m)
    degrees = np.column_stack([np.degrees(lat), np.degrees(lon), h])
    rows = [joined(n, *x, by=",") for n, x in zip(eo.images, degrees.tolist(), strict=True)]
    (antenna := tmp_path / "antenna.csv").write_text("name,lat,lon,h\n" + "".join(rows))
    plane, right = TangentPlane(*eo.origin), site_crs(tmp_path)
    ground = GroundTableInput(file=points, crs=right)
    placed = ground_in_plane(BlockFile(path=points, ground=ground), None, eo, [])
    assert placed is not None
    assert np.abs(placed.position_m - eo.position_m).max() < 1e-3
    block_poses = read_camera_poses(path, Hints(crs=right))
    flight = eo.position_m, plane, "flight.toml"
    assert refuse_distant(block_poses, Hints(crs=right), *flight) == ()
    assert compare_files(eo, path, crs=right).findings == ()
    (elsewhere := tmp_path / "31").mkdir()
    wrong = site_crs(elsewhere, "EPSG:32631")
    far = "km apart, which no datum or base station explains"
    block_poses = read_camera_poses(path, Hints(crs=wrong))
    posed = SimpleNamespace(eo=eo), np.arange(len(eo.images)), SimpleNamespace()
    file = SimpleNamespace(path="flight.toml")
    with pytest.raises(InputError, match=far):
        in_flight._refuse_other_poses(block_poses, Hints(crs=wrong), *posed, file)
    options = SimilarityOptions(crs=wrong)
    with pytest.raises(InputError, match=far):
        calibrate_similarity(path, antenna, options)
    assert far in " ".join(compare_files(eo, path, crs=wrong).notes)
    ground = GroundTableInput(file=points, crs=wrong)
    with pytest.raises(InputError, match="km from the images"):
        ground_in_plane(BlockFile(path=points, ground=ground), None, eo, [])


def test_a_distance_that_a_calibration_takes_for_a_shift_is_said(tmp_path: Path) -> None:
    """Oracle: what was done: heights in feet, a kilometre, the height of a geoid; nothing."""
    eo = orientation_at(46.57, 6.54)
    at = in_map(eo, "EPSG:32632")
    placed = eo.position_m, TangentPlane(*eo.origin), "flight.toml"
    for change, said in (
        (lambda x: x, ""),
        (lambda x: x + [1000.0, 0.0, 0.0], "a constant shift of E +999"),
        (lambda x: x / [1.0, 1.0, 0.3048], "heights of b are in feet"),
        (lambda x: x - [0.0, 0.0, 49.5], "the size of a geoid height"),
    ):
        path = ign_opk(replace(at, coordinates=change(at.coordinates)), tmp_path)
        hints = Hints(crs="EPSG:32632")
        notes = refuse_distant(read_camera_poses(path, hints), hints, *placed)
        assert len(notes) == bool(said)
        assert said in " ".join(notes)


def test_a_shift_that_was_lost_is_asked_for(tmp_path: Path) -> None:
    """Oracle: the block, once what was subtracted is given; calibrations take axes of their own
    where the CRS may be that of a table, and none where it is of the poses alone.
    """
    eo = block()
    path = colmap(framed(eo, "EPSG:32632"), tmp_path)
    file = path / "images.txt"
    lines = file.read_text().splitlines(keepends=True)
    comment = next(line for line in lines if line.startswith("# shift:"))
    file.write_text("".join(line for line in lines if line != comment))
    shift = tuple(map(float, comment.split()[2:5]))
    with pytest.raises(InputError, match=r"lie outside the area of EPSG:32632 .*--shift"):
        insgnss.read_poses(path, crs="EPSG:32632")
    with pytest.raises(InputError, match="lie outside the area"):
        read_camera_poses(path, Hints(crs="EPSG:32632"))
    assert read_camera_poses(path, Hints(crs="EPSG:32632"), only=False).frame == "own"
    assert max(differ(eo, path, crs="EPSG:32632", shift=shift)) < 1e-4
    got = read_camera_poses(path, Hints(crs="EPSG:32632", shift=shift))
    assert isinstance(got.plane, TangentPlane)


@pytest.mark.slow  # PROJ looks for grids there
def test_another_zone_or_unit_is_asked_for(tmp_path: Path) -> None:
    """Oracle: LV95 coordinates lie in the Atlantic as those of Lambert-93."""
    path = metashape_opk_text(framed(block(), "EPSG:2056"), tmp_path)
    for wrong in ("EPSG:2154", "EPSG:4326"):
        with pytest.raises(InputError, match=r"lie outside the area|no longitude and latitude"):
            insgnss.read_poses(path, crs=wrong)
    flight = SimpleNamespace(camera="a camera", path=tmp_path)
    with pytest.raises(InputError, match="lie outside the area of EPSG:2154"):
        calibrate_mounting(flight, path, Assumptions(crs="EPSG:2154"))  # type: ignore[arg-type]


@pytest.mark.parametrize("crs", ["EPSG:2056", "EPSG:2154", "EPSG:4150"])
def test_a_chunk_of_another_ellipsoid_is_where_its_texts_are(tmp_path: Path, crs: str) -> None:
    """Oracle: the coordinates that Metashape shows: the transforms have them as points of the
    CRS's own ellipsoid, by pyproj's cart; Bessel's and that of WGS 84 lie 800 m apart.
    """
    eo, system = block(), CRS(crs)
    size = f"+a={system.ellipsoid.semi_major_metre} +rf={system.ellipsoid.inverse_flattening}"
    cart = Transformer.from_pipeline(
        f"+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad +step +proj=cart {size}"
    )
    truth = framed(eo, "geographic")
    bessel = CRS("EPSG:4150").to_3d()
    lon, lat, h = Transformer.from_crs("EPSG:4979", bessel, always_xy=True).transform(
        *np.degrees(truth.coordinates[:, :2].T), truth.coordinates[:, 2]
    )
    if crs == "EPSG:2154":
        lon, lat = np.degrees(truth.coordinates[:, :2].T)
    height = truth.coordinates[:, 2] if crs != "EPSG:4150" else h
    rows = ""
    for k, name in enumerate(eo.images):
        T = np.eye(4)
        T[:3, :3] = enu_axes(lat[k], lon[k]) @ truth.C_Ec[k]
        T[:3, 3] = cart.transform(lon[k], lat[k], height[k])
        rows += f'<camera id="{k}" label="{name}"><transform>{numbers(T)}</transform></camera>'
    same = "<rotation>1 0 0 0 1 0 0 0 1</rotation><translation>0 0 0</translation>"
    wkt = system.to_wkt("WKT1_GDAL").replace("\n", "")
    (tmp_path / "a.xml").write_text(
        f'<document version="2.0.0"><chunk label="c"><cameras>{rows}</cameras><transform>{same}'
        f"</transform><reference>{wkt}</reference></chunk></document>"
    )
    metres, degrees = differ(eo, tmp_path / "a.xml")
    assert metres < 1e-3
    assert degrees < 2e-3  # seconds of arc between the verticals of two ellipsoids
