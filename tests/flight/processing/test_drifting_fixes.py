"""Fixes that drift for half a minute are said, whatever noise explains them as well."""

from dataclasses import replace

import numpy as np
import pytest

import insgnss

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("speed_mps", [0.0, 0.02])
def test_a_drift_of_the_fixes_is_said(speed_mps):
    """Oracle: what was planted: up by 2 cm/s for 15 s, and back again, claimed as 2 and 3 cm."""
    sim = insgnss.simulate("ign8", 8.0, imu_rate_hz=100.0, seed=52)
    since = sim.gnss.time - sim.gnss.time[0] - 150.0
    up = speed_mps * np.clip(15.0 - np.abs(since - 15.0), 0.0, None)
    result = insgnss.estimate(
        sim.imu,
        replace(sim.gnss, height=sim.gnss.height + up),
        sim.events,
        mounting=sim.mounting,
        tangent_plane=(
            *np.degrees([sim.tangent_plane.lat, sim.tangent_plane.lon]),
            sim.tangent_plane.height,
        ),
    )
    drifts = [check.found for check in result.checks if check.name == "drift"]
    assert len(drifts) == (speed_mps > 0.0)
    assert all("sigmas in velocity D at" in found for found in drifts)
