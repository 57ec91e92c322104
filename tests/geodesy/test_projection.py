"""Projected CRS against PROJ's factors, published values and distances on the ellipsoid."""

import struct
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from insgnss.base.errors import InputError, UsageError
from insgnss.geodesy import grids
from insgnss.geodesy.projection import MapProjection

LAT, LON, H = np.radians([46.57, 46.60]), np.radians([6.54, 6.60]), np.array([630.0, 1200.0])


def _convergence(G: np.ndarray) -> np.ndarray:
    return np.degrees(np.arctan2(G[:, 1, 0], G[:, 0, 0]))


@pytest.mark.parametrize(
    "code", ["EPSG:32632", "EPSG:32631", "EPSG:25832", "EPSG:2154", "EPSG:3031"]
)
def test_convergence_and_scale_of_a_geocentric_datum(code: str) -> None:
    """Oracle: PROJ's analytical factors; 1e-8 rad, a hundredth of what six decimals of a degree
    show. The axes are a rotation about the vertical.
    """
    from pyproj import CRS, Proj

    projection = MapProjection(code)
    factors = Proj(CRS(code)).get_factors(np.degrees(LON), np.degrees(LAT))
    G = projection.axes(LAT, LON, H)
    assert np.abs(G @ G.swapaxes(1, 2) - np.eye(3)).max() < 1e-15
    assert (G[:, 2] == [0.0, 0.0, 1.0]).all()
    assert np.abs(_convergence(G) - factors.meridian_convergence).max() < np.degrees(1e-8)
    N = 6378137.0 / np.sqrt(1.0 - 0.00669437999014 * np.sin(LAT) ** 2)
    M = N**3 / 6378137.0**2 * (1.0 - 0.00669437999014)
    along = np.asarray(factors.meridional_scale) * np.sqrt(M / (M + H) * N / (N + H))
    assert projection.ground_scale(LAT, LON, H) == pytest.approx(along, abs=1e-8)


def test_convergence_at_the_test_field() -> None:
    """Oracle: formats.md C3, to the printed digits."""
    for code, printed in (("EPSG:2056", -0.6574), ("EPSG:32632", -1.7870), ("EPSG:32631", 2.5724)):
        assert _convergence(MapProjection(code).axes(LAT, LON, H))[0] == pytest.approx(
            printed, abs=5.1e-5
        )


def test_position_in_lv95() -> None:
    """Oracle: PROJ in three dimensions; the height stays the one above WGS84's ellipsoid."""
    from pyproj import CRS, Transformer

    x = MapProjection("2056").forward(LAT, LON, H)
    E, N, _ = Transformer.from_crs("EPSG:4979", CRS("EPSG:2056").to_3d(), always_xy=True).transform(
        np.degrees(LON), np.degrees(LAT), H
    )
    assert np.abs(x - np.column_stack([E, N, H])).max() < 1e-9


@pytest.mark.parametrize(
    "code", ["EPSG:2056", "EPSG:32632", "EPSG:31467", "EPSG:2051", "EPSG:5514"]
)
def test_inverse(code: str) -> None:
    """Oracle: the forward projection; a tenth of a millimetre, the digits of an export."""
    projection = MapProjection(code)
    lat, lon, h = projection.inverse(projection.forward(LAT, LON, H))
    assert np.abs(lat - LAT).max() < 1.5e-11
    assert np.abs(lon - LON).max() < 1.5e-11
    assert np.abs(h - H).max() < 1e-4


def test_axes_that_are_not_east_and_north() -> None:
    """Oracle: the definition of EPSG:2051, which counts west and south: half a turn and the
    convergence.
    """
    from pyproj import CRS, Proj

    south = np.radians([-30.0]), np.radians([24.5]), np.array([100.0])
    factors = Proj(CRS("EPSG:2051")).get_factors(24.5, -30.0)
    turned = _convergence(MapProjection("EPSG:2051").axes(*south))[0]
    assert (turned - factors.meridian_convergence) % 360.0 == pytest.approx(180.0, abs=1e-6)


def test_geoid_of_the_users(tmp_path: Path) -> None:
    """Oracle: a grid that is 48 m everywhere."""
    grid = tmp_path / "geoid.gtx"
    head = (
        np.array([40.0, 0.0, 1.0, 1.0]).astype(">f8").tobytes()
        + np.array([20, 20]).astype(">i4").tobytes()
    )
    grid.write_bytes(head + np.full(400, 48.0).astype(">f4").tobytes())
    projection = MapProjection("EPSG:32632", grid)
    x = projection.forward(LAT, LON, H)
    assert np.abs(x[:, 2] - (H - 48.0)).max() < 1e-5
    assert np.abs(projection.inverse(x)[2] - H).max() < 1e-5
    assert projection.heights == "above the geoid geoid.gtx"
    with pytest.raises(InputError, match="does not reach the flight"):
        projection.forward(np.radians([-40.0]), LON[:1], H[:1])


@pytest.mark.parametrize(
    ("code", "why"),
    [
        ("EPSG:99999", "is unknown; give an EPSG code"),
        ("nonsense", "is unknown"),
        ("EPSG:4326", "is not projected"),
        ("EPSG:2263", "counts in US survey feet, .* its metric sibling, EPSG:32118"),
        ("EPSG:2256", "counts in feet, .* its metric sibling, EPSG:32100"),
        ("EPSG:6347+6360", r"has heights in US survey feet, .* \+5703"),
        ("EPSG:5513", "left-handed"),
        ("EPSG:3857", "not conformal"),
    ],
)
def test_refusals(code: str, why: str) -> None:
    """Oracle: the definitions of the registry."""
    with pytest.raises(UsageError, match=why):
        MapProjection(code).axes(LAT, LON, H)


def test_heights_whose_grid_is_not_here() -> None:
    """Oracle: the registry; LN02 needs a grid that PROJ does not bring along."""
    with pytest.raises(
        InputError, match=r"ch_swisstopo_chgeo2004_ETRS89_LN02\.tif is not installed"
    ):
        MapProjection("EPSG:2056+5728").forward(LAT, LON, H)
    with pytest.raises(UsageError, match="leave the geoid out"):
        MapProjection("EPSG:2056+5728", __file__)  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="does not exist"):
        MapProjection("EPSG:2056", "nowhere.gtx")  # type: ignore[arg-type]
    with pytest.raises(UsageError, match=r"`pyproj sync --file ch_swisstopo_nowhere\.tif`"):
        MapProjection("EPSG:2056", "ch_swisstopo_nowhere.tif")  # type: ignore[arg-type]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("code", "datum", "grid", "lat", "lon"),
    [
        ("EPSG:6347+5703", "EPSG:6319", "us_noaa_g2018u0.tif", 40.7, -74.0),
        ("EPSG:6539+6360", None, "us_noaa_g2018u0.tif", 40.7, -74.0),
        ("EPSG:2154+5720", None, "fr_ign_RAF18.tif", 46.0, 3.0),
    ],
)
def test_heights_that_several_grids_would_reach(
    code: str, datum: str | None, grid: str, lat: float, lon: float
) -> None:
    """Oracle: the registry of PROJ: GEOID18 for NAVD88, RAF18 for NGF-IGN69, the only ones that lie
    on the datum of the plan; the command is that of pyproj.
    """
    if _is_there(grid):
        pytest.skip(f"{grid} is installed")
    projection = MapProjection(code, None, datum, any_unit=True)
    with pytest.raises(
        InputError, match=rf"need a grid: {grid} is not .*`pyproj sync --file {grid}`"
    ):
        projection.forward(np.radians([lat]), np.radians([lon]), np.array([100.0]))


@pytest.mark.parametrize(
    ("ways", "named"),
    [
        ([("rough", 0.5), ("fine", 0.1)], "fine"),
        ([("unknown", -1.0), ("rough", 0.5)], "rough"),
        ([("two", 0.01), ("rough", 0.5)], "rough"),
    ],
)
def test_of_several_grids_the_fewest_and_most_accurate_are_named(
    monkeypatch: pytest.MonkeyPatch, ways: list[tuple[str, float]], named: str
) -> None:
    """Oracle: by hand: an accuracy below zero is not known; the way "two" lacks two grids."""
    every = [
        SimpleNamespace(
            accuracy=accuracy,
            grids=[SimpleNamespace(available=False, url="https", short_name=name)]
            * (2 if name == "two" else 1),
        )
        for name, accuracy in ways
    ]
    monkeypatch.setattr(
        grids, "operations", lambda *_: SimpleNamespace(unavailable_operations=every)
    )
    text = grids.lacking_grids("a+b", None, None, LAT, LON)
    assert f"its heights need a grid: {named} is not installed" in text


@pytest.mark.parametrize(
    ("code", "sibling", "datum", "metres"),
    [
        ("EPSG:2263", "EPSG:32118", "EPSG:4269", 1200.0 / 3937.0),
        ("EPSG:6539", "EPSG:6538", "EPSG:6319", 1200.0 / 3937.0),
        ("EPSG:2232", "EPSG:26954", "EPSG:4269", 1200.0 / 3937.0),
        ("EPSG:2256", "EPSG:32100", "EPSG:4269", 0.3048),
    ],
)
def test_a_crs_in_feet_is_its_metric_sibling(
    code: str, sibling: str, datum: str, metres: float
) -> None:
    """Oracle: PROJ's own numbers of the CRS times the foot by definition (1200/3937 m of the US
    survey, 0.3048 m), and the sibling in metres: the same axes, the same way back.
    """
    from pyproj import Transformer

    area = {"EPSG:2232": (39.5, -105.5), "EPSG:2256": (46.5, -110.0)}.get(code, (40.75, -73.9))
    lat, lon, h = np.radians([area[0]] * 2), np.radians([area[1], area[1] + 0.01]), H[:2]
    feet = MapProjection(code, None, datum, any_unit=True)
    x = feet.forward(lat, lon, h)
    raw = Transformer.from_crs(datum, code, always_xy=True).transform(*np.degrees([lon, lat]))
    assert [unit.metres for unit in feet.units] == pytest.approx([metres, metres], rel=1e-12)
    assert np.abs(x[:, :2] - metres * np.column_stack(raw)).max() < 1e-6
    assert (x[:, 2] == h).all()
    assert np.abs(x - MapProjection(sibling, None, datum).forward(lat, lon, h)).max() < 1e-4
    back = feet.inverse(x)
    assert np.abs(np.array([back[0] - lat, back[1] - lon])).max() < 1e-11
    metric = MapProjection(sibling, None, datum)
    assert np.abs(feet.axes(lat, lon, h) - metric.axes(lat, lon, h)).max() < 1e-9
    assert feet.ground_scale(lat, lon, h) == pytest.approx(metric.ground_scale(lat, lon, h))


@pytest.mark.slow
def test_heights_in_feet_are_metres_here(tmp_path: Path) -> None:
    """Oracle: a geoid 33 m below the ellipsoid; heights of the CRS are in feet of the US survey."""
    grid = tmp_path / "geoid.gtx"
    head = struct.pack(">4d2i", 40.0, -75.0, 0.1, 0.1, 20, 20)
    grid.write_bytes(head + np.full(400, -33.0).astype(">f4").tobytes())
    text = f"+proj=utm +zone=18 +datum=WGS84 +units=m +geoidgrids={grid} +vunits=us-ft +type=crs"
    lat, lon, h = np.radians([40.7]), np.radians([-74.0]), np.array([100.0])
    projection = MapProjection(text, any_unit=True)
    x = projection.forward(lat, lon, h)
    assert x[0, 2] == pytest.approx(133.0, abs=1e-4)
    assert projection.inverse(x)[2][0] == pytest.approx(100.0, abs=1e-6)
    assert projection.unit_m == pytest.approx([1.0, 1.0, 1200.0 / 3937.0])
    with pytest.raises(UsageError, match="has heights in US survey feet"):
        MapProjection(text)


OSTN15 = "uk_os_OSTN15_NTv2_OSGBtoETRS.tif"
# Ordnance Survey, OSTN15_OSGM15_TestInput and TestOutput_ETRStoOSGB: TP01 St Mary's, TP10, TP20
OS_LAT = np.radians([49.92226393730, 51.8589089640, 53.8002151963])
OS_LON = np.radians([-6.29977752014, -4.3085247696, -1.66379168242])
OS_GRID = np.array([[91492.146, 11318.804], [241124.584, 220332.641], [422242.186, 433818.701]])


def _is_there(grid: str) -> bool:
    from pyproj.datadir import get_data_dir, get_user_data_dir

    return any((Path(d) / grid).is_file() for d in (get_data_dir(), get_user_data_dir()))


@pytest.mark.parametrize("datum", [None, "EPSG:4937"])
def test_no_british_grid_without_its_grid(datum: str | None) -> None:
    """Oracle: three control points published by Ordnance Survey, to 2 mm, where the grid is
    installed. Without it a Helmert transformation misses them by 2 to 5 m, which nobody must
    get; the grid is named and how to get it.
    """
    from pyproj import CRS, Transformer

    h = np.full(3, 100.0)
    projection = MapProjection("EPSG:27700", None, datum)
    if _is_there(OSTN15):
        x = MapProjection("EPSG:27700", None, "EPSG:4937").forward_horizontal(OS_LAT, OS_LON, h)
        assert np.abs(x - OS_GRID).max() < 2e-3
        return
    helmert = Transformer.from_crs(
        "EPSG:4979", CRS("EPSG:27700").to_3d(), always_xy=True, allow_ballpark=False
    )
    E, N, _ = helmert.transform(np.degrees(OS_LON), np.degrees(OS_LAT), h)
    off = np.hypot(E - OS_GRID[:, 0], N - OS_GRID[:, 1])
    assert off == pytest.approx([4.7, 1.9, 1.7], abs=0.1)
    with pytest.raises(InputError, match=rf"{OSTN15}.* not installed.* sync --file {OSTN15}`"):
        projection.forward(OS_LAT, OS_LON, h)
    with pytest.raises(InputError, match=rf"pyproj sync --file {OSTN15}`"):
        MapProjection("EPSG:27700+5701", None, datum).forward(OS_LAT, OS_LON, h)


def _ntv2(path: Path, north_s: float, east_s: float) -> None:
    """A grid of one shift over the British Isles, seconds of arc, in the format NTv2."""

    def word(key: str, value: str | float) -> bytes:
        data = value.ljust(8).encode() if isinstance(value, str) else struct.pack("<d", value)
        return key.ljust(8).encode() + data

    def count(key: str, n: int) -> bytes:
        return key.ljust(8).encode() + struct.pack("<ii", n, 0)

    head = count("NUM_OREC", 11) + count("NUM_SREC", 11) + count("NUM_FILE", 1)
    for key in ("GS_TYPE", "VERSION", "SYSTEM_F", "SYSTEM_T"):
        head += word(key, "SECONDS" if key == "GS_TYPE" else "1")
    for key, axis in (("MAJOR_F", 6377563.396), ("MINOR_F", 6356256.909)):
        head += word(key, axis)
    for key, axis in (("MAJOR_T", 6378137.0), ("MINOR_T", 6356752.314)):
        head += word(key, axis)
    for key in ("SUB_NAME", "PARENT", "CREATED", "UPDATED"):
        head += word(key, "NONE" if key == "PARENT" else "ALL")
    limits = {"S_LAT": 49.0, "N_LAT": 61.0, "E_LONG": -3.0, "W_LONG": 9.0}
    for key, degrees in (limits | {"LAT_INC": 1.0, "LONG_INC": 1.0}).items():
        head += word(key, 3600.0 * degrees)
    nodes = 13 * 13
    shifts = struct.pack("<ffff", north_s, -east_s, 0.0, 0.0) * nodes
    path.write_bytes(head + count("GS_COUNT", nodes) + shifts + word("END", 0.0))


def test_a_grid_that_is_installed_is_taken(tmp_path: Path) -> None:
    """Oracle: a grid of our own in the place of the British one, of one shift (1.5 and 5 seconds):
    the projection of what it moves, by PROJ, to 0.1 mm. In a process of its own, since PROJ's
    directories are those of a process.
    """
    from pyproj import Transformer

    _ntv2(tmp_path / OSTN15, -1.5, 5.0)
    run = """
import sys, numpy as np, pyproj.datadir
pyproj.datadir.append_data_dir(sys.argv[1])
from insgnss.geodesy.projection import MapProjection
place = np.radians([51.85]), np.radians([-4.31]), np.array([100.0])
for datum in (None, "EPSG:4937"):
    print(*MapProjection("EPSG:27700", None, datum).forward(*place)[0])
"""
    out = subprocess.run(
        [sys.executable, "-c", run, str(tmp_path)], capture_output=True, text=True, check=True
    )
    own = Transformer.from_crs("EPSG:4277", "EPSG:27700", always_xy=True)
    expected = own.transform(-4.31 - 5.0 / 3600.0, 51.85 + 1.5 / 3600.0)
    for line in out.stdout.splitlines():
        assert [float(v) for v in line.split()] == pytest.approx([*expected, 100.0], abs=1e-4)
    assert len(out.stdout.splitlines()) == 2


@pytest.mark.parametrize(
    ("code", "lat", "lon"),
    [
        ("EPSG:32632", 48.5, 9.0),
        ("EPSG:25832", 48.5, 9.0),
        ("EPSG:2056", 46.5, 7.0),
        ("EPSG:21781", 46.5, 7.0),
        ("EPSG:2154", 48.0, 2.0),
        ("EPSG:28992", 52.5, 5.0),
        ("EPSG:31256", 48.0, 16.0),
        ("EPSG:5514", 50.0, 15.0),
        ("EPSG:28356", -33.8, 151.2),
        ("EPSG:6339", 37.5, -122.0),
        ("EPSG:6677", 35.7, 139.7),
    ],
)
def test_what_no_missing_grid_would_better_is_not_refused(
    code: str, lat: float, lon: float
) -> None:
    """Oracle: PROJ's own figures of accuracy, by which no grid that is missing is better here."""
    x = MapProjection(code).forward(np.radians([lat]), np.radians([lon]), np.array([100.0]))
    assert np.isfinite(x).all()


@pytest.mark.slow
def test_positions_of_a_moving_datum() -> None:
    """Oracle: GDA2020 Technical Manual: ITRF2014 and GDA2020 are one at 2020.0, and part by the
    rotation of 1.50379, 1.18346, 1.20716 mas a year. In Europe the plate's 24 mm a year (ITRF2014
    plate motion model, to 1 mm a year).
    """
    place = np.radians([-33.8]), np.radians([151.2]), np.array([50.0])
    at = {
        epoch: MapProjection("EPSG:7856", None, "EPSG:7912", epoch).forward(*place)[0]
        for epoch in (2020.0, 2024.5)
    }
    same = MapProjection("EPSG:7856").forward(*place)[0]
    assert np.abs(at[2020.0] - same).max() < 1e-6
    lat, lon = place[0][0], place[1][0]
    up = np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
    east = np.array([-np.sin(lon), np.cos(lon), 0.0])
    omega = np.array([1.50379, 1.18346, 1.20716]) * 1e-3 / 3600.0 * np.pi / 180.0
    moved = 4.5 * np.cross(omega, 6371e3 * up)
    expected = -np.array([moved @ east, moved @ np.cross(up, east)])
    turn = MapProjection("EPSG:7856").axes(*place)[0][:2, :2]
    assert (at[2024.5] - at[2020.0])[:2] == pytest.approx(turn @ expected, abs=2e-3)
    place = np.radians([48.5]), np.radians([9.0]), np.array([50.0])
    x, y = (
        MapProjection("EPSG:25832", None, "EPSG:7912", epoch).forward(*place)[0]
        for epoch in (2010.0, 2020.0)
    )
    assert np.hypot(*(y - x)[:2]) == pytest.approx(0.247, abs=0.01)


@pytest.mark.parametrize(
    ("datum", "epoch", "why"),
    [
        ("nonsense", None, "datum 'nonsense' is unknown; give the geographic CRS"),
        ("EPSG:32632", None, "is not geographic"),
        ("EPSG:4978", None, "is not geographic"),
        ("EPSG:9989", None, "moves by centimetres a year against the ground; give the epoch"),
        (None, 2024.5, "epoch 2024.5 belongs to a datum"),
    ],
)
def test_datums_that_are_none(datum: str | None, epoch: float | None, why: str) -> None:
    """Oracle: the registry's definitions."""
    with pytest.raises(UsageError, match=why):
        MapProjection("EPSG:25832", None, datum, epoch)


@pytest.mark.parametrize(("code", "outside"), [("EPSG:3395", 0), ("EPSG:32632", 2)])
def test_what_is_outside_is_counted_by_what_it_is_beyond(code, outside):
    """Oracle: areas of use of the registry: 180 W to 180 E, 80 S to 84 N; 6 to 12 E, 0 to 84 N."""
    projection = MapProjection(code)
    lat, lon = np.radians([47.0, 47.0, -33.0]), np.radians([8.0, 20.0, 9.0])
    assert projection.outside(lat, lon) == outside
    assert projection.degrees_outside(lat[1:2], lon[1:2]) == pytest.approx(8.0 * bool(outside))
