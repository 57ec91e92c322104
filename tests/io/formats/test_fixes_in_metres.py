"""Fixes whose positions are metres: geocentric, or local about a reference point."""

import numpy as np
import pytest
import scipy.io
from numpy.testing import assert_allclose

from insgnss.base.errors import InputError
from insgnss.flight.inspection.tables.grids import tables_of_file
from insgnss.flight.inspection.tables.tabular import sources_of_table
from insgnss.io.formats import read_gnss

RADIUS_M = 6378137.0  # of the equator, WGS84
NORTH_M = 3.0 * np.arange(60.0)


def written(path, header, columns):
    tow = 1000.0 + 0.5 * np.arange(60.0)
    table = np.column_stack([tow, *(np.broadcast_to(c, 60) for c in columns)])
    np.savetxt(path, table, "%.6f", ",", header=header, comments="")
    return path


def test_geocentric_positions_turn_their_deviations(tmp_path):
    """Oracle: on the equator at longitude 90 deg y is up, -x east and z north, by hand."""
    header = "tow,X-ECEF(m),Y-ECEF(m),Z-ECEF(m),sd_x,sd_y,sd_z"
    path = written(tmp_path / "a.csv", header, [0.0, RADIUS_M + 100.0, NORTH_M, 0.1, 0.2, 0.3])
    fixes = read_gnss(path)
    assert_allclose(np.degrees([fixes.lon[0], fixes.lat[0]]), [90.0, 0.0], atol=1e-12)
    assert_allclose(fixes.height[0], 100.0, atol=1e-6)
    sigma = np.sqrt(np.diagonal(fixes.cov_ned[0]))
    assert_allclose(sigma, [0.3, 0.1, 0.2], rtol=1e-6)


@pytest.mark.parametrize("vertical", ["down", "up"])
@pytest.mark.parametrize("stated", ["comment", "option", "mat"])
def test_local_positions_count_from_their_reference(tmp_path, vertical, stated):
    """Oracle: by hand: 5 m above the point's own height in its zenith, north of it thereafter."""
    point = (46.57, 6.54, 500.0)
    up = 5.0 if vertical == "up" else -5.0
    header = f"tow,north,east,{vertical}"
    if stated == "comment":
        header = f"# home: {point[0]} {point[1]} {point[2]} m\n{header}"
    path = written(tmp_path / "a.csv", header, [NORTH_M, 0.0, up])
    how = {"sigma_m": (1.0, 1.0, 1.0)}
    if stated != "comment":
        with pytest.raises(
            InputError, match=r"a\.csv:2: north east .* give this point as gnss\.reference"
        ):
            read_gnss(path, **how)
        how["reference"] = point
    if stated == "mat":
        path = tmp_path / "a.mat"
        gps = {"t": 1000.0 + np.arange(60.0), "n": NORTH_M, "e": 0.0 * NORTH_M}
        scipy.io.savemat(path, {"gps": gps | {"v": up + 0.0 * NORTH_M}})
        names = ("tow", "north", "east", vertical)
        how["columns"] = dict(zip(names, ("gps.t", "gps.n", "gps.e", "gps.v"), strict=True))
    fixes = read_gnss(path, **how)
    assert_allclose(np.degrees([fixes.lat[0], fixes.lon[0]]), point[:2], atol=1e-12)
    assert_allclose(fixes.height[0], 505.0, atol=1e-8)
    assert_allclose((fixes.lat[2] - fixes.lat[0]) * 6.3697e6, 6.0, atol=1e-3)


def test_kilometres_are_refused(tmp_path):
    """Oracle: the first line, with the radius."""
    path = written(tmp_path / "a.csv", "tow,ecef_x,ecef_y,ecef_z", [0.0, 6378.2, 1e-3 * NORTH_M])
    with pytest.raises(InputError, match=r"a\.csv:2: x y z lie 6378 m from the Earth's centre"):
        read_gnss(path, sigma_m=(1.0, 1.0, 1.0))


@pytest.mark.parametrize("header", ["tow,x,y,z", ""])
def test_inspect_knows_geocentric_positions_by_their_radius(tmp_path, header):
    """Oracle: the columns put in; what it drafts is what the reader takes."""
    t = np.arange(60.0)
    west, north = 100.0 * np.cos(t / 8.0), 100.0 * np.sin(t / 8.0)
    path = written(tmp_path / "a.csv", header, [-west, RADIUS_M + 100.0, north])
    if not header:
        path.write_text(path.read_text().lstrip("\n"))
    (table,) = tables_of_file(path)
    (source,) = sources_of_table(path, table)
    assert source.role == "gnss"
    assert not source.free_height
    columns = source.keys["columns"]
    assert [name for name in columns if name != "tow"] == ["x", "y", "z"]
    fixes = read_gnss(path, columns=columns, sigma_m=source.keys["sigma_m"])
    assert_allclose(np.degrees(fixes.lon), 90.0, atol=0.02)
