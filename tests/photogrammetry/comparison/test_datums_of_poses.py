"""The datum goes with every position: into files, back from them, and between two of them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pyproj import Transformer
from sites import orientation_at

from insgnss.base.errors import UsageError
from insgnss.flight.exporting.export import ExportFrame, export
from insgnss.geodesy.frames import TangentPlane
from insgnss.geodesy.grids import geoid_file
from insgnss.geodesy.projection import MapProjection
from insgnss.photogrammetry.comparison.compare import compare_files
from insgnss.records import ExteriorOrientation

ITRF, NAD83 = "EPSG:7912", "EPSG:6319"
PLACE = 39.74, -105.0, 1600.0  # Denver
CAMERA = "PINHOLE,5120,3840,5607,5607,2560,1920"
FILES = {  # of formats that name a CRS: their options, and the frame
    "metashape": ("geographic", {}),
    "metashape_opk": ("geographic", {}),
    "pix4d_matic": ("geographic", {}),
    "odm": ("geographic", {}),
    "bentley": ("geographic", {}),
    "realitycapture": ("geographic", {}),
    "generic_ascii": ("geographic", {}),
    "geojson": ("geographic", {}),
    "tum": ("geocentric", {}),
    "opf": ("EPSG:6342", {"camera": CAMERA, "pixel_size_um": 4.0}),
}


def flown(datum: str | None = ITRF, epoch: float | None = 2023.5) -> ExteriorOrientation:
    return orientation_at(*PLACE, datum, epoch)


def in_nad83(eo: ExteriorOrientation) -> tuple[np.ndarray, ...]:
    """Longitude, latitude, deg, and height of images of ITRF2014 in NAD83(2011), by pyproj."""
    lat, lon, h = TangentPlane(*eo.origin).geodetic_from_position(eo.position_m)
    to = Transformer.from_crs(ITRF, NAD83, always_xy=True)
    return to.transform(np.degrees(lon), np.degrees(lat), h, np.full(h.size, 2023.5))[:3]


def apart(a: object, b: object) -> tuple[np.ndarray, str]:
    """Mean of b - a, east, north, up, m, and what was recognised and noted."""
    done = compare_files(a, b)  # type: ignore[arg-type]
    mean = np.array([part.difference.mean() for part in done.components[:3]])
    return mean, "; ".join([*(f.statement for f in done.findings), *done.notes])


def test_positions_of_two_datums_are_compared_in_one() -> None:
    """Oracle: pyproj, at the epoch of the one that moves."""
    eo = flown()
    lon, lat, h = in_nad83(eo)
    moved, notes = apart(eo, replace(eo, datum=NAD83, epoch=None))
    there = TangentPlane(*eo.origin).position_from_geodetic(np.radians(lat), np.radians(lon), h)
    assert np.abs(moved - (eo.position_m - there).mean(axis=0)).max() < 1e-4
    assert "of EPSG:7912 at 2023.5, those of b of EPSG:6319: b is transformed" in notes
    own = np.array([np.radians(lat[0]), np.radians(lon[0]), h[0]])
    x = TangentPlane(*own).position_from_geodetic(np.radians(lat), np.radians(lon), h)
    same = replace(eo, origin=own, position_m=x, datum=NAD83, epoch=None)
    assert np.abs(apart(eo, same)[0]).max() < 1e-4


def test_a_declared_geographic_crs_is_the_datum_of_a_file(tmp_path: Path) -> None:
    """Oracle: the datum of the export; its table of longitude and latitude names none."""
    eo = flown()
    file = export(eo, "metashape", tmp_path / "m.csv", ExportFrame(NAD83)).file
    done = compare_files(eo, file, crs=NAD83)
    assert not done.findings
    assert np.abs([part.difference for part in done.components[:3]]).max() < 2e-4
    assert "those of b of EPSG:6319: b is transformed" in "; ".join(done.notes)


def test_epochs_differ_by_the_motion_of_the_plate() -> None:
    """Oracle: the pole of Eurasia in ITRF2014, -0.085 -0.531 0.770 mas/yr (Altamimi et al. 2017);
    that of ETRF2000, by which ETRS89 is reached, differs from it by 0.5 mm a year.
    """
    eo = orientation_at(46.5, 6.6, 400.0, ITRF, 2010.0)
    moved, notes = apart(eo, replace(eo, epoch=2023.5))
    plane = TangentPlane(*eo.origin)
    omega = np.radians(np.array([-0.085, -0.531, 0.770]) / 3.6e6)
    way = 13.5 * plane.C_em.T @ np.cross(omega, plane.origin_ecef)
    assert np.linalg.norm(way) > 0.3
    assert np.abs(moved + way)[:2].max() < 13.5 * 6e-4
    assert "b is transformed by the motion of its plate" in notes


@pytest.mark.parametrize(
    ("place", "datum", "epoch", "why"),
    [
        (PLACE, None, None, "datums differ by up to 2 m"),
        ((35, 139, 0), ITRF, 2020, "at one epoch"),
        (PLACE, ITRF, 2290.0, "epoch 2290 is no decimal year of GNSS positions, 1980 to 2100"),
    ],
)
def test_what_cannot_be_transformed_is_said(place, datum, epoch, why) -> None:
    """Oracle: without a datum, or where the ground moves by faults (Japan), numbers stay; 2290 is a
    GPS week. Positions that are equal by their numbers are not good of two datums.
    """
    pair = orientation_at(*place, ITRF, 2023.5), orientation_at(*place, datum, epoch)
    moved, notes = apart(*pair)
    assert np.abs(moved).max() < 1e-9
    assert why in notes
    assert "Doubtful: positions of a are of EPSG:7912" in compare_files(*pair).summary()


@pytest.mark.parametrize("form", FILES)
def test_files_name_the_datum_of_their_positions(form: str, tmp_path: Path) -> None:
    """Oracle: the code of the datum; a file goes back to its master and is pyproj's shift off the
    same numbers of the other datum.
    """
    frame, options = FILES[form]
    target = ExportFrame(frame) if frame.startswith("EPSG") else ExportFrame(frame=frame)
    masters = {ITRF: flown(), NAD83: flown(NAD83, None)}
    for datum, eo in masters.items():
        done = export(eo, form, tmp_path / f"x{datum[5:]}{form}", target, **options)
        written = [done.file, *done.helpers]
        written += sorted(done.file.iterdir()) if done.file.is_dir() else []
        text = "".join(file.read_text() for file in written if file.is_file())
        code = {ITRF: "7789", NAD83: "6317"}[datum] if frame == "geocentric" else datum[5:]
        assert code in text
        assert ":4979" not in text
        assert "WGS" not in text
        if form in ("geojson", "opf", "odm"):
            continue
        assert np.abs(apart(eo, done.file)[0]).max() < 2e-4
        if form in ("pix4d_matic", "bentley", "tum") and datum == NAD83:
            lon, lat, h = in_nad83(masters[ITRF])
            there = TangentPlane(*eo.origin).position_from_geodetic(*np.radians([lat, lon]), h)
            shift = (eo.position_m - there).mean(axis=0)
            assert np.abs(apart(masters[ITRF], done.file)[0] - shift).max() < 3e-4


def test_heights_go_along_into_the_datum_of_the_crs(tmp_path: Path) -> None:
    """Oracle: pyproj in three dimensions; a geoid counts from there, and LV95 stays as it was."""
    eo = flown()
    lat, lon, h = TangentPlane(*eo.origin).geodetic_from_position(eo.position_m)
    projection = MapProjection("EPSG:6342", None, ITRF, 2023.5)
    x = projection.forward(lat, lon, h)
    e, n = Transformer.from_crs("EPSG:6318", "EPSG:6342", always_xy=True).transform(
        *in_nad83(eo)[:2]
    )
    assert np.abs(x - np.column_stack([e, n, in_nad83(eo)[2]])).max() < 1e-4
    assert projection.heights == "above the ellipsoid of NAD83(2011)"
    back = projection.inverse(x)
    assert np.abs(back[2] - h).max() < 1e-6
    swiss = MapProjection("EPSG:2056", None, "EPSG:4937")
    place = np.radians([46.5]), np.radians([6.6]), np.array([500.0])
    assert swiss.forward(*place)[0, 2] == 500.0
    assert swiss.heights == "above the ellipsoid of ETRS89"
    export(eo, "odm", tmp_path / "geo.txt", ExportFrame(NAD83))
    rows = np.loadtxt(tmp_path / "geo.txt", skiprows=1, usecols=(1, 2, 3), comments="#")
    assert np.abs((rows - np.column_stack(in_nad83(eo))) * [8e4, 1.1e5, 1.0]).max() < 1e-4


@pytest.mark.parametrize(
    ("name", "grid"),
    [
        ("GEOID18", "us_noaa_g2018u0.tif"),
        ("egm96_15.gtx", "us_nga_egm96_15.tif"),
        ("EGM2008", "us_nga_egm08_25.tif"),
        ("RAF20.tac", "fr_ign_RAF20.tif"),
    ],
)
def test_a_geoid_by_name_says_where_to_get_it(name: str, grid: str) -> None:
    """Oracle: the names of the agencies in PROJ's list of grids."""
    with pytest.raises(UsageError, match=f"`pyproj sync --file {grid}"):
        geoid_file(Path(name))
    with pytest.raises(UsageError, match=r"get it by `pyproj sync --file us_nga_egm08_25\.tif"):
        geoid_file(Path("egm2008"))  # before that of Spain
    with pytest.raises(UsageError, match="PROJ has none of that name"):
        geoid_file(Path("mine.gtx"))
