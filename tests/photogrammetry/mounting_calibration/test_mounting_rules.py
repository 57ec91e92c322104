"""Limits of the calibration of a mounting, on either side, and misfits in closed form."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from insgnss.base.errors import InputError
from insgnss.photogrammetry.mounting_calibration import judgement, plausibility
from insgnss.photogrammetry.mounting_calibration.plausibility import (
    FlightPath,
    PoseMisfit,
    gross_errors,
    misfit,
    refuse_frame,
)


def test_poses_of_a_path_between_its_instants() -> None:
    """Oracle: by hand: positions on a straight line, the nearer attitude; none beyond the ends."""
    C = Rotation.from_rotvec(np.outer([0.0, 0.1, 0.2], [0.0, 0.0, 1.0])).as_matrix()
    path = FlightPath(np.array([10.0, 11.0, 13.0]), np.array([[0.0] * 3, [1.0] * 3, [5.0] * 3]), C)
    X, attitude = path.at(np.array([10.0, 10.4, 10.6, 12.0, 13.0]))
    assert_allclose(X[:, 0], [0.0, 0.4, 0.6, 3.0, 5.0])
    assert_allclose(attitude, C[[0, 0, 1, 2, 2]])
    assert path.at(np.array([9.9, 12.0])) is None
    assert path.at(np.array([10.0, 13.1])) is None


def test_the_misfit_of_poses_is_what_similarity_and_bore_sight_leave() -> None:
    """Oracle: scipy: poses in another frame with another camera have none; what is put on beside
    comes out as its root mean square."""
    rng = np.random.default_rng(3)
    X, C = 50.0 * rng.normal(size=(40, 3)), Rotation.random(40, rng=1)
    R, E = Rotation.random(rng=2), Rotation.from_rotvec([0.1, -0.2, 0.3])
    X_o, C_o = 2.0 * R.apply(X) + [5.0, 6.0, 7.0], (R * C * E).as_matrix()
    exact = misfit(X, C.as_matrix(), X_o, C_o)
    assert exact.position_m < 1e-9
    assert exact.attitude_rad < 1e-6
    e, psi = 0.3 * rng.normal(size=(40, 3)), 1e-3 * rng.normal(size=(40, 3))
    turned = (R * C * Rotation.from_rotvec(psi) * E).as_matrix()
    noisy = misfit(X, C.as_matrix(), X_o + e, turned)
    assert noisy.position_m == pytest.approx(np.sqrt((e**2).sum(axis=1).mean()), rel=0.12)
    assert noisy.attitude_rad == pytest.approx(np.sqrt((psi**2).sum(axis=1).mean()), rel=0.05)
    assert PoseMisfit(3.0, math.radians(0.4)).size == pytest.approx(5.0)
    line = np.outer(np.arange(40.0), [1.0, 2.0, 0.0])
    along = misfit(line, C.as_matrix(), 2.0 * R.apply(line), (R * C).as_matrix())
    assert along.position_m < 1e-6


@pytest.mark.parametrize(
    ("metres", "degrees", "count", "gross"),
    [
        (0.19, 0.0, 1, False),  # ten times the median
        (0.21, 0.0, 1, True),
        (0.0, 0.39, 1, False),
        (0.0, 0.41, 1, True),
        (9.0, 0.0, 5, True),
        (9.0, 0.0, 6, False),  # more than a twentieth are no single ones
    ],
)
def test_single_poses_far_off(metres, degrees, count, gross) -> None:
    """Oracle: limits by hand: ten times the median of 2 cm and of 0.04 deg, of a hundred images."""
    e = np.zeros((100, 6))
    e[:, 1], e[:, 4] = 0.02, math.radians(0.04)
    e[:count, 1] = max(metres, 0.02)
    e[:count, 4] = math.radians(max(degrees, 0.04))
    names = [f"{k}.jpg" for k in range(100)]
    good, words = gross_errors(SimpleNamespace(residuals=e, block=SimpleNamespace(images=names)))
    assert np.count_nonzero(~good) == len(words) == (count if gross else 0)
    small, _ = gross_errors(
        SimpleNamespace(residuals=1e-2 * e, block=SimpleNamespace(images=names))
    )
    assert small.all()  # below a decimetre and 0.2 deg nothing is gross


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({}, None),
        ({"factor": 0.0099}, "of this flight's own trajectory"),
        ({"factor": 0.0099, "redundancy": 49.0}, None),
        ({"turn_deg": 19.0}, None),
        ({"turn_deg": 21.0}, "turned by 21 deg"),
        ({"turn_deg": 91.0}, r"with \[\[.*1\.0 deg remain"),
        ({"scale": 1.0009}, None),
        ({"scale": 1.0011}, "0.11 % too small"),
        ({"scale": 0.9989}, "0.11 % too large"),
        ({"scale": 1.0049, "sigma": 1e-3}, None),  # five sigmas
        ({"scale": 1.0051, "sigma": 1e-3}, "0.51 % too small"),
        ({"scale": 2.0, "georeferenced": False}, None),
    ],
)
def test_when_a_block_is_no_block_of_this_flight(changes, message) -> None:
    """Oracle: limits by hand, on either side: a hundredth of the flight's variances, 20 deg, 0.1 %
    and five sigmas of the scale."""
    angle = math.radians(changes.get("turn_deg", 0.0))
    solved = SimpleNamespace(
        boresight_change=Rotation.from_rotvec([0.0, 0.0, angle]).as_matrix(),
        block=SimpleNamespace(source="b", georeferenced=changes.get("georeferenced", True)),
        flight=SimpleNamespace(eo=SimpleNamespace(camera_from_body=np.eye(3))),
        flight_factor=(changes.get("factor", 1.0), changes.get("redundancy", 51.0)),
        assumptions=SimpleNamespace(frame="map"),
        values={plausibility.BLOCK_SCALE: np.array([changes.get("scale", 1.0)])},
        sigma=lambda _: np.array([changes.get("sigma", 1e-6)]),
    )
    if message is None:
        refuse_frame(solved)
        return
    with pytest.raises(InputError, match=message):
        refuse_frame(solved)


def test_the_lines_that_are_tried_turn_about_the_vertical() -> None:
    """Oracle: a line to the north that is flown back leads south, one across it east."""
    north, east = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    led = {"opposite": -north, "across": east, "70 % of the speed": north}
    for variant in judgement._variants():
        expected = next((v for word, v in led.items() if word in variant.name), None)
        if variant.turn is None:
            assert expected is None
        else:
            assert_allclose(variant.turn @ north, expected, rtol=0, atol=1e-12)
