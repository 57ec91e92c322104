"""Heights of a barometer, one a second on the level of the fixes."""

from dataclasses import replace

import numpy as np
import pytest

from insgnss.base.errors import InputError
from insgnss.navigation.prepare.barometer import level_heights, refuse_apart
from insgnss.records import BarometerHeights, GnssFixes, ImuSamples

FIX_TIME = np.arange(100.0, 161.0)
HEIGHT = 500.0 + 2.0 * (FIX_TIME - 100.0)
FIXES = GnssFixes.from_degrees(
    FIX_TIME, np.full(61, 46.0), np.full(61, 6.0), HEIGHT, sigma_m=(0.02, 0.02, 0.03)
)


def climb(low: float, high: float, hz: float) -> BarometerHeights:
    """A climb of 2 m/s that is 480 m lower on the barometer's scale."""
    time = np.arange(low, high, 1.0 / hz)
    return BarometerHeights(time, 20.0 + 2.0 * (time - 100.0))


def test_one_mean_a_second_at_the_mean_of_its_stamps_on_the_level_of_the_fixes():
    """Oracle: a line, of which every mean lies on it."""
    found = level_heights(climb(90.05, 170.0, 10.0), FIXES, 105.0, 150.0)
    assert found.shape == (45, 2)
    assert found[:2, 0] == pytest.approx([105.5, 106.5])
    assert found[:, 1] == pytest.approx(500.0 + 2.0 * (found[:, 0] - 100.0), abs=1e-9)


def test_the_level_is_not_moved_by_a_spell_of_wrong_heights():
    """Oracle: the median of 60 differences, of which 20 are 30 m too high."""
    one = climb(100.0, 160.0, 1.0)
    wrong = BarometerHeights(one.time, one.height + 30.0 * (one.time >= 140.0))
    found = level_heights(wrong, FIXES, 100.0, 160.0)
    assert found[:40, 1] == pytest.approx(HEIGHT[:40], abs=1e-9)
    assert found[40:, 1] == pytest.approx(HEIGHT[40:60] + 30.0, abs=1e-9)


def test_a_slow_or_silent_barometer():
    """Oracle: hand calculation: every sample by itself, none at all."""
    found = level_heights(climb(100.0, 160.0, 0.2), FIXES, 100.0, 160.0)
    assert found[:, 0].tolist() == np.arange(100.0, 160.0, 5.0).tolist()
    assert level_heights(climb(100.0, 120.0, 1.0), FIXES, 130.0, 160.0).shape == (0, 2)


def test_a_barometer_of_another_time_is_refused():
    """Oracle: both spans, as the message says them."""
    time = np.arange(0.0, 50.0, 0.1)
    imu = ImuSamples(time, np.zeros((500, 3)), np.zeros((500, 3)), source="imu.csv")
    fixes = replace(FIXES, time=FIX_TIME - FIX_TIME[0])
    refuse_apart(climb(49.0, 60.0, 1.0), imu, fixes)
    message = "heights from 100.0 to 159.0 s, imu.csv: samples from 0.0 to 49.9 s"
    with pytest.raises(InputError, match=message):
        refuse_apart(climb(100.0, 160.0, 1.0), imu, fixes)
