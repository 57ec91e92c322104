"""Files whose frame is declared wrongly: the mistake is named or asked about, and nothing else."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sites import orientation_at
from test_ways_back import Site, ign_opk, odm_shots, realitycapture_camera, site_at

from insgnss.base.errors import InputError
from insgnss.geodesy.frames import TangentPlane, geodetic_to_ecef
from insgnss.photogrammetry.comparison.compare import compare_files
from insgnss.records import ExteriorOrientation

Change = Callable[[np.ndarray], np.ndarray]


def same(x: np.ndarray) -> np.ndarray:
    return x


def times(*factors: float) -> Change:
    return lambda x: x * factors


def plus(*terms: float) -> Change:
    return lambda x: x + terms


def written(site: Site, change: Change) -> Path:
    """IGN's table, of which every row has other coordinates."""
    path = ign_opk(site)
    head, *rows = path.read_text().splitlines()
    for k, row in enumerate(rows):
        words = row.split()
        words[1:4] = [f"{v:.10f}" for v in change(np.array(words[1:4], dtype=float))]
        rows[k] = " ".join(words)
    path.write_text("\n".join([head, *rows]) + "\n")
    return path


ASKED = {  # place, CRS that is declared, change of the coordinates, what the error says
    "LV95 for UTM": ("Lausanne", "EPSG:32632", same, "the numbers fit EPSG:2056 CH1903"),
    "LV95 for LV03": ("Lausanne", "EPSG:21781", same, "the numbers fit EPSG:2056 CH1903"),
    "no CRS": ("Sydney", None, same, "the numbers fit EPSG:7856 GDA2020"),
    "feet for metres": ("Denver", "EPSG:6427", same, r"the numbers fit EPSG:6428 NAD83\(2011\)"),
    "metres for feet": (
        "Denver",
        "EPSG:6428",
        times(*[1200 / 3937] * 3),
        r"the numbers fit EPSG:6427 NAD83\(2011\)",
    ),
    "map for ECEF": ("Paris", "EPSG:4978", same, "km above the ellipsoid; .* fit EPSG:2154"),
    "map for degrees": ("Paris", "EPSG:4326", same, "are no longitude and latitude"),
    "kilometres": (
        "Kamchatka",
        "EPSG:32660",
        times(1e-3, 1e-3, 1.0),
        "what was subtracted from them",
    ),
    "shift of no whole kilometres": (
        "Kamchatka",
        "EPSG:32660",
        plus(-499512.0, -6873511.0, 0.0),
        "what was subtracted from them",
    ),
    "millimetres of height": (
        "Paris",
        "EPSG:2154",
        times(1.0, 1.0, 1e3),
        "are 159 km in metres; give their own unit",
    ),
}


@pytest.mark.parametrize("name", ASKED)
def test_a_wrong_declaration_is_asked_about(name: str, tmp_path: Path) -> None:
    """Oracle: the CRS in which the file was written."""
    place, crs, change, why = ASKED[name]
    site = site_at(place, tmp_path)
    with pytest.raises(InputError, match=why):
        compare_files(site.eo, written(site, change), crs=crs)


FOOT = (1200 / 3937) / 0.3048
NAMED = {  # place, CRS that is declared, change, the only finding; of none, what the notes say
    "east and north": (
        "Kamchatka",
        "EPSG:32660",
        lambda x: x[[1, 0, 2]],
        "b has east and north exch",
    ),
    "heights in feet": ("Paris", "EPSG:2154", times(1, 1, 1 / 0.3048), "heights of b are in feet"),
    "another foot": ("Denver", "EPSG:6428", times(FOOT, FOOT, 1.0), "b has international feet,"),
    "another datum": ("Sydney", "EPSG:28356", same, "a constant shift of E +0.5"),
    "another zone": ("Kamchatka", "EPSG:32659", same, "numbers of b fit EPSG:32660 WGS 84"),
    "south for north": ("Kamchatka", "EPSG:32760", same, "km apart, which no datum"),
    "a zone's prefix": ("Kamchatka", "EPSG:32660", plus(6e7, 0.0, 0.0), "-60000000 0 0 were"),
    "a lost shift": (
        "Kamchatka",
        "EPSG:32660",
        plus(-499e3, -6873e3, 0.0),
        "0 were subtracted",
    ),
}


@pytest.mark.parametrize("name", NAMED)
def test_a_wrong_declaration_is_named_alone(name: str, tmp_path: Path) -> None:
    """Oracle: what was changed; no turn, lever arm or attitude is made out of it."""
    place, crs, change, why = NAMED[name]
    site = site_at(place, tmp_path)
    done = compare_files(site.eo, written(site, change), crs=crs)
    if done.findings:
        assert len(done.findings) == 1
        assert done.findings[0].statement.startswith(why)
    else:
        assert why in " ".join(done.notes)


def in_crs(crs: str) -> Callable[[Site], np.ndarray]:
    """Coordinates of another CRS than that of the site."""
    return lambda site: np.array([x for _, x, *_ in replace(site, crs=crs).rows])


def changed(change: Change) -> Callable[[Site], np.ndarray]:
    return lambda site: np.array([change(x) for _, x, *_ in site.rows])


def globe(change: Change) -> Callable[[Site], np.ndarray]:
    """Longitude, latitude, deg, and height, changed."""

    def coordinates(site: Site) -> np.ndarray:
        lat, lon, h = TangentPlane(*site.eo.origin).geodetic_from_position(site.eo.position_m)
        return change(np.column_stack([np.degrees(lon), np.degrees(lat), h]))

    return coordinates


def packed(x: np.ndarray) -> np.ndarray:
    """Degrees and minutes without a blank, as receivers print them."""
    return 100.0 * (x // 1.0) + 60.0 * (x % 1.0)


def radians(x: np.ndarray) -> np.ndarray:
    return np.column_stack([np.radians(x[:, :2]), x[:, 2]])


def geocentric(x: np.ndarray) -> np.ndarray:
    return geodetic_to_ecef(np.radians(x[:, 1]), np.radians(x[:, 0]), x[:, 2])


SAID = {  # place, CRS that is declared, coordinates of the file, the one thing that is said
    "degrees for metres": ("Kamchatka", "EPSG:32660", globe(same), "fit EPSG:4326 WGS 84"),
    "degrees and minutes": ("Kamchatka", "EPSG:4326", globe(packed), "no longitude and latitude"),
    "latitude first": ("Sydney", "EPSG:4326", globe(lambda x: x[:, [1, 0, 2]]), "latitude stands"),
    "radians": ("Kamchatka", "EPSG:4326", globe(radians), "b has latitude and longitude in rad"),
    "south": ("Kamchatka", "EPSG:4326", globe(times(1, -1, 1)), "b has latitudes with the other"),
    "ECEF for a map": ("Lausanne", "EPSG:2056", globe(geocentric), "heights such as 4605"),
    "ECEF for degrees": ("Lausanne", "EPSG:4326", globe(geocentric), "no longitude and latitude"),
    "UTM for LV95": ("Lausanne", "EPSG:2056", in_crs("EPSG:32632"), "fit EPSG:32632 WGS 84"),
    "LV03 for LV95": ("Lausanne", "EPSG:2056", in_crs("EPSG:21781"), "fit EPSG:21781 CH1903"),
    "north for south": ("Sydney", "EPSG:32656", changed(same), "no transformation from GDA2020"),
    "zone of the datum": ("Sydney", "EPSG:28355", changed(same), "of b fit EPSG:7856 GDA2020"),
    "zone in feet": ("Denver", "EPSG:6430", changed(same), "numbers of b fit EPSG:6428 NAD83"),
    "Lambert's zone": ("Paris", "EPSG:3949", changed(same), "the numbers fit EPSG:2154 RGF93"),
    "Lambert II": ("Paris", "EPSG:27572", changed(same), "the numbers fit EPSG:2154 RGF93"),
    "UTM for Lambert": ("Paris", "EPSG:32631", changed(same), "numbers of b fit EPSG:2154 RGF93"),
    "centimetres": ("Kamchatka", "EPSG:32660", changed(times(1e2, 1e2, 1)), "as 50000000.000 6874"),
    "west for east": (
        "Kamchatka",
        "EPSG:32660",
        changed(times(-1, 1, 1)),
        "b has east with the other",
    ),
    "height first": ("Kamchatka", "EPSG:32660", changed(lambda x: x[[2, 0, 1]]), "are 6874 km in"),
    "depths": ("Paris", "EPSG:2154", changed(times(1, 1, -1)), "b counts heights downwards"),
    "sea level": ("Paris", "EPSG:2154", changed(plus(0, 0, -44.6)), "44.600 m below those of a"),
    "metres of height": (
        "Denver",
        "EPSG:6428",
        changed(times(1, 1, 1200 / 3937)),
        "heights of b are in metres",
    ),
    "feet of a zone": ("Kamchatka", "EPSG:32660", changed(times(*[1 / 0.3048] * 3)), "60 in feet"),
    "kilometres of it": ("Paris", "EPSG:2154", changed(times(1e-3, 1e-3, 1)), "2154 in kilometres"),
    "heights in cm": ("Paris", "EPSG:2154", changed(times(1, 1, 100)), "of b are in centimetres"),
    "zone beyond": ("Lausanne", "EPSG:2056", in_crs("EPSG:32633"), "fit EPSG:32633 WGS 84"),
    "no false easting": (
        "Kamchatka",
        "EPSG:32660",
        changed(plus(-5e5, 0, 0)),
        "500000 0 0 were subtracted",
    ),
}


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.slow if "fit" in why or "no trans" in why else ())
        for name, (*_, why) in SAID.items()
    ],
)
def test_one_thing_is_said_of_a_wrong_declaration(name: str, tmp_path: Path) -> None:
    """Oracle: what was changed; a refusal, else one finding alone, else a note without finding."""
    place, crs, coordinates, why = SAID[name]
    site = site_at(place, tmp_path)
    places = iter(coordinates(site))
    file = written(site, lambda _: next(places))
    try:
        done = compare_files(site.eo, file, crs=crs)
        statements = [finding.statement for finding in done.findings] or [" ".join(done.notes)]
    except InputError as refusal:
        statements = [str(refusal)]
    assert len(statements) == 1
    assert why in statements[0]


def test_another_epoch_and_datum_are_named_with_their_size(tmp_path: Path) -> None:
    """Oracle: NAD83(2011) stands still, ITRF2014 moves against it by 1.7 cm a year in Denver."""
    site = site_at("Denver", tmp_path)
    file = written(site, same)
    shifts = []
    for epoch in (2010.0, 2023.5):
        eo = replace(site.eo, datum="EPSG:7912", epoch=epoch)
        (finding,) = compare_files(eo, file, crs=site.crs).findings
        assert finding.name == "shift"
        shifts.append([finding.values[f"{axis}_m"] for axis in ("east", "north", "up")])
    moved = np.subtract(*shifts)
    assert np.linalg.norm(moved) == pytest.approx(13.5 * 0.0175, rel=0.1)


def degrees(eo: ExteriorOrientation, site: Site, columns: tuple[int, int], east: float) -> Path:
    """IGN's table with longitude and latitude."""
    lat, lon, h = TangentPlane(*eo.origin).geodetic_from_position(eo.position_m)
    plan = np.column_stack([east * np.degrees(lon), np.degrees(lat)])[:, columns]
    places = iter(np.column_stack([plan, h]))
    return written(site, lambda _: next(places))


@pytest.mark.parametrize(
    ("columns", "east", "why"),
    [((1, 0), 1.0, "b has latitude and longitude exch"), ((0, 1), -1.0, "b has longitudes with")],
)
def test_degrees_exchanged_or_of_another_sign(columns, east, why, tmp_path: Path) -> None:
    """Oracle: what was changed; at the central meridian the axes of the map are those of east."""
    site = site_at("Kamchatka", tmp_path)
    site.eo = orientation_at(62.0, 177.0 if columns == (0, 1) else 15.0)
    site.crs = "EPSG:32660" if columns == (0, 1) else "EPSG:32633"
    done = compare_files(site.eo, degrees(site.eo, site, columns, east), crs="EPSG:4326")
    assert done.findings[0].statement.startswith(why)


def test_a_tangent_plane_that_is_declared_a_zone(tmp_path: Path) -> None:
    """Oracle: the axes of the other file; 500 km and 6874 km less leave 180 m of a shift."""
    site = site_at("Kamchatka", tmp_path)
    with pytest.raises(InputError, match="what was subtracted from them"):
        compare_files(site.eo, site.export("micmac_xml", "Ori-Nav"), crs="EPSG:32660")


def test_exchanged_coordinates_of_a_geojson(tmp_path: Path) -> None:
    """Oracle: longitude 177 in the place of the latitude."""
    site = site_at("Kamchatka", tmp_path)
    path = odm_shots(site)
    text = re.sub(r'"coordinates": \[(\S+), (\S+),', r'"coordinates": [\2, \1,', path.read_text())
    path.write_text(text)
    with pytest.raises(InputError, match=r"latitude 177.* GeoJSON has longitude first"):
        compare_files(site.eo, path)


def test_decimal_commas_of_a_flight_log(tmp_path: Path) -> None:
    """Oracle: the sign, which doubles the fields of a line."""
    path = realitycapture_camera(site_at("Paris", tmp_path))
    head, rows = path.read_text().split("alt,heading", 1)
    path.write_text(head + "alt,heading" + rows.replace(".", ","))
    with pytest.raises(InputError, match="are the decimal signs commas"):
        compare_files(site_at("Paris", tmp_path).eo, path, crs="EPSG:2154")


def test_decimal_commas(tmp_path: Path) -> None:
    """Oracle: the sign."""
    path = written(site_at("Paris", tmp_path), same)
    head, rows = path.read_text().split("\n", 1)
    path.write_text(head + "\n" + rows.replace(".", ","))
    with pytest.raises(InputError, match=r":2: .*are the decimal signs commas"):
        compare_files(site_at("Paris", tmp_path).eo, path, crs="EPSG:2154")
