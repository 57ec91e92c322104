"""The deflection of the vertical: stated it turns gravity, and its sigma is in every attitude."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import insgnss
from insgnss.geodesy.rotation import vector_from_rotation

ARCSEC = np.radians(1.0 / 3600.0)
XI_ETA = (30.0, -20.0)  # arcsec, 36 in all


@pytest.fixture(scope="module")
def sim() -> Any:
    """A flight of six minutes where the plumb line leans to the north-west: the specific force that
    this adds is turned into body axes by the exact attitude.
    """
    flat = insgnss.simulate("ign8", 6.0, imu_rate_hz=100.0, seed=3)
    middle = flat.imu.time - 0.005
    force = 9.807 * ARCSEC * np.array([*XI_ETA, 0.0])
    leaning = np.einsum("nij,i->nj", flat.flight.motion.C_lb(middle), force)
    return replace(flat, imu=replace(flat.imu, accel=flat.imu.accel + leaning))


def estimated(sim: Any, **more: Any) -> tuple[Any, np.ndarray]:
    """The result, and its errors of the attitude in the axes of the plane, rad."""
    plane = sim.tangent_plane
    result = insgnss.estimate(
        *(sim.imu, sim.gnss, sim.events),
        mounting=sim.mounting,
        tangent_plane=(*np.degrees([plane.lat, plane.lon]), plane.height),
        gnss__time_sigma_s=5e-5,
        **{f"gnss__deflection_{name}": value for name, value in more.items()},
    )
    at = [sim.truth.eo.images.index(name) for name in result.eo.images]
    turn = sim.truth.eo.C_mc[at] @ np.swapaxes(result.eo.C_mc, -1, -2)
    return result, vector_from_rotation(turn)


@pytest.mark.slow
def test_a_stated_deflection_turns_gravity_and_its_sigma_is_carried(sim):
    """Oracle: the exact motion, and definition: a level that leans by xi to the north and eta to
    the east turns the images about east and north by as much. The sigma adds its square to the
    variances and to what neighbours share, about horizontal axes alone.
    """
    assumed, error = estimated(sim)
    stated, error_stated = estimated(sim, arcsec=XI_ETA)
    exact, _ = estimated(sim, arcsec=XI_ETA, sigma_arcsec=0.0)
    leaning = (error - error_stated).mean(axis=0) / ARCSEC
    np.testing.assert_allclose(leaning[:2], [-XI_ETA[0], XI_ETA[1]], atol=3.0)
    for result, of_attitude in ((assumed, error), (stated, error_stated)):
        sigma = np.sqrt(np.diagonal(result.eo.cov, axis1=1, axis2=2))[:, 3:]
        assert np.abs(of_attitude / sigma).max() < 4.0
    assert np.linalg.norm(error_stated.mean(axis=0)[:2]) < 0.3 * np.linalg.norm(leaning) * ARCSEC
    added = (5.0 * ARCSEC) ** 2 * np.diag([1.0, 1.0, 0.0])
    for with_it, without in ((stated.eo.cov, exact.eo.cov), (stated.eo.cross, exact.eo.cross)):
        differences = (with_it - without)[:, 3:, 3:]
        np.testing.assert_allclose(
            differences, np.tile(added, (len(differences), 1, 1)), atol=1e-13
        )
    growth = np.sqrt(np.diagonal(stated.eo.cov / exact.eo.cov, axis1=1, axis2=2))
    assert growth.max() < 1.3
