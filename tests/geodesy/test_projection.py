"""Projected CRS against PROJ's factors, published values and distances on the ellipsoid."""

from pathlib import Path

import numpy as np
import pytest

from insgnss.base.errors import InputError, UsageError
from insgnss.geodesy.projection import MapProjection

LAT, LON, H = np.radians([46.57, 46.60]), np.radians([6.54, 6.60]), np.array([630.0, 1200.0])


def _convergence(G: np.ndarray) -> np.ndarray:
    return np.degrees(np.arctan2(G[:, 1, 0], G[:, 0, 0]))


@pytest.mark.parametrize(
    "code", ["EPSG:32632", "EPSG:32631", "EPSG:25832", "EPSG:2154", "EPSG:3031"]
)
def test_convergence_and_scale_of_a_geocentric_datum(code: str) -> None:
    """Oracle: PROJ's analytical factors; 1e-8 rad, a hundredth of what six decimals of a degree
    show.
    """
    from pyproj import CRS, Proj

    projection = MapProjection(code)
    factors = Proj(CRS(code)).get_factors(np.degrees(LON), np.degrees(LAT))
    G = projection.axes(LAT, LON, H)
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
        ("EPSG:2263", "counts in US survey foot"),
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
