"""Solutions of a base whose position is known later."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from insgnss.base.errors import InputError, OptionError
from insgnss.flight.config.gnss_options import GnssInput
from insgnss.flight.processing.input_files import _read_fixes
from insgnss.geodesy.frames import TangentPlane, geodetic_to_ecef
from insgnss.navigation.prepare.moved_base import MovedBase
from insgnss.records import ExteriorOrientation
from insgnss.records.cameras.camera_positions import CameraPositions

BASE = (46.57, 6.54, 500.0)
RAISED = (46.57, 6.54, 502.0)
SIGMA_M = (0.01, 0.02, 0.03)


def over_the_base(north_m):
    """Camera positions above the base and so far north of it."""
    plane = TangentPlane(*np.radians(BASE[:2]), BASE[2])
    x = np.array([[0.0, 0.0, 100.0], [0.0, north_m, 100.0]])
    cov = np.tile(0.04 * np.eye(3), (2, 1, 1))
    places = plane.geodetic_from_position(x)
    return CameraPositions("ab", [0.0, 1.0], *places, cov, np.ones(2), np.ones(2), 2200)


def test_positions_move_with_their_base():
    """Oracle: by hand: a base raised by 2 m raises what is above it by 2 m, and shifts what is
    elsewhere along the same vector; variances grow by those of the base and, 10 km away, by
    (2 m x 10 km / 20 000 km)^2."""
    before = over_the_base(10_000.0)
    after = MovedBase(BASE, RAISED, SIGMA_M).positions(before)
    assert_allclose(after.height[0] - before.height[0], 2.0, atol=1e-8)
    assert_allclose(np.degrees([after.lat[0], after.lon[0]]), BASE[:2], atol=1e-13)
    step = geodetic_to_ecef(*np.radians(BASE[:2]), 502.0) - geodetic_to_ecef(
        *np.radians(BASE[:2]), 500.0
    )
    moved = geodetic_to_ecef(after.lat, after.lon, after.height)
    assert_allclose(moved - geodetic_to_ecef(before.lat, before.lon, before.height), [step] * 2)
    grown = np.diag(np.square(SIGMA_M)) + (2.0 * 1e4 / 2e7) ** 2 * np.eye(3)
    assert_allclose(after.cov_ned[0], 0.04 * np.eye(3) + grown, atol=1e-9)


def test_images_share_the_error_of_their_base():
    """Oracle: the same by hand, in the axes east, north, up; the covariance between neighbours
    grows by as much as their variances."""
    n, eye = 3, np.eye(6)
    x = np.array([[k, 0.0, 100.0] for k in range(n)], dtype=float)
    turns = np.tile(np.eye(3), (n, 1, 1))
    eo = ExteriorOrientation(
        *(
            tuple("abc"),
            np.arange(n, dtype=float),
            2200,
            [*np.radians(BASE[:2]), BASE[2]],
            x,
            turns,
        ),
        *(np.tile(eye, (n, 1, 1)), np.tile(0.5 * eye, (n - 1, 1, 1)), np.eye(3), np.eye(3)),
    )
    after = MovedBase(BASE, RAISED, SIGMA_M).orientation(eo)
    assert_allclose(after.position_m - x, [[0.0, 0.0, 2.0]] * n, atol=1e-8)
    grown = np.zeros((6, 6))
    grown[range(3), range(3)] = np.square([0.02, 0.01, 0.03])
    assert_allclose(after.cov - eo.cov, [grown] * n, atol=1e-9)
    assert_allclose(after.cross - eo.cross, [grown] * (n - 1), atol=1e-9)
    assert "0.0000 m north and 2.0000 m up" in after.history[-1]


def test_fixes_of_a_file_move_and_other_bases_are_refused(tmp_path):
    """Oracle: 2 m by hand; a header that names a base 5 m away is contradicted in one line."""
    lines = ["%  GPST  latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   sdu(m)"]
    lines[0] += "  sdne(m)  sdeu(m)  sdun(m) age(s)  ratio"
    lines += [f"2200 {k}.000 46.57 6.54 600.0 1 9 0.03 0.04 0.05 0 0 0 0 9" for k in range(3)]
    file = tmp_path / "antenna.pos"
    file.write_text("\n".join(lines) + "\n")
    moved = _read_fixes(GnssInput(file=file, moved_base=[BASE, RAISED]), None, None)
    assert_allclose(moved.height, 602.0, atol=1e-8)
    header = "% ref pos : 46.570000000 6.540000000 505.0000\n"
    file.write_text(header + "\n".join(lines) + "\n")
    with pytest.raises(
        InputError, match=r"46\.570000000,6\.540000000,505\.000, 5\.0 m from the old"
    ):
        _read_fixes(GnssInput(file=file, moved_base=[BASE, RAISED]), None, None)


def test_a_base_that_cannot_be_is_refused():
    """Oracle: one line each, with the limit."""
    with pytest.raises(OptionError, match=r"are 11\d{3} m apart \(limit 1000 m\)"):
        GnssInput(file="a.pos", moved_base=[BASE, (46.47, 6.54, 500.0)])
    with pytest.raises(OptionError, match="must be the old and the new position of the base"):
        GnssInput(file="a.pos", moved_base=BASE)
    exchanged = (BASE[1], BASE[0], BASE[2])
    with pytest.raises(InputError, match=r"km from it \(limit 300 km\)"):
        MovedBase(exchanged, exchanged).positions(over_the_base(10.0))
