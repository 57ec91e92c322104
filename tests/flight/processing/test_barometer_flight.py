"""A barometer beside the fixes: what it holds while there are none, and what becomes of a wrong
one.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

import insgnss
from insgnss.flight.processing.input_files import input_files

OUTAGE_S = 60.0
BIAS_M, SCALE, WALK, WHITE_M = 37.0, 0.03, 0.1, 0.5


def flown(seed: int, minutes: float = 3.0):
    """A flight with the sensors of a phone, without fixes for a minute in its middle, and the
    instant of that.
    """
    sim = insgnss.simulate(
        "ign8", minutes, imu_rate_hz=100.0, noise="consumer", seed=seed, start_in_air=True
    )
    fixes, middle = sim.gnss, 0.5 * (sim.gnss.time[0] + sim.gnss.time[-1])
    seen = np.abs(fixes.time - middle) > 0.5 * OUTAGE_S
    kept = {name: getattr(fixes, name)[seen] for name in ("time", "lat", "lon", "height")}
    return sim, replace(fixes, **kept, cov_ned=fixes.cov_ned[seen]), middle


def barometer(sim, seed: int) -> np.ndarray:
    """Heights at 10 Hz with bias, scale factor, random walk, and an error that stays for a second.

    Time s, height m.
    """
    draw = np.random.default_rng(seed)
    time = np.arange(sim.imu.time[0], sim.imu.time[-1], 0.1)
    height = true_height(sim, time)
    walk = WALK * np.sqrt(0.1) * np.cumsum(draw.normal(size=time.size))
    white = WHITE_M * np.repeat(draw.normal(size=time.size // 10 + 1), 10)[: time.size]
    above = (1.0 + SCALE) * (height - height[0])
    return np.column_stack([time, BIAS_M + above + walk + white])


def true_height(sim, time: np.ndarray) -> np.ndarray:
    """Of the IMU above the ellipsoid, m."""
    motion = sim.flight.motion
    return motion.frame.geodetic_from_position(motion.position(time))[2]


def at_middle(sim, fixes, middle: float, heights=None):
    """Error of the smoothed height in the middle of the outage and its sigma, m; the result."""
    result = insgnss.estimate(
        sim.imu, fixes, barometer=heights, mounting=sim.mounting, noise="consumer"
    )
    path = result.trajectory
    k = int(np.argmin(np.abs(path.time - middle)))
    error = true_height(sim, path.time[k : k + 1])[0] - path.height[k]
    return error, float(np.sqrt(path.cov[k, 2, 2])), result


@pytest.mark.slow
def test_it_holds_the_height_while_there_are_no_fixes():
    """Oracle: the exact motion; sigmas with and without, of the same flight."""
    sim, fixes, middle = flown(3)
    _, without, _ = at_middle(sim, fixes, middle)
    error, sigma, result = at_middle(sim, fixes, middle, barometer(sim, 3))
    assert without == pytest.approx(0.9, abs=0.1)
    assert sigma < 0.5 * without
    assert abs(error) < 3.3 * sigma  # one in a thousand
    counts = result.report["counts"]
    assert counts["barometer_heights"] == 180
    assert counts["barometer_heights_used"] + counts["barometer_heights_rejected"] == 180
    assert result.report["consistency"]["barometer"]["verdict"] == "consistent"
    assert "heights of the barometer: 180 offered" in " ".join(result.report["history"])


@pytest.mark.slow
def test_its_heights_are_as_good_as_their_sigmas():
    """Oracle: chi-square of 12 flights, 99 % on both sides."""
    z = []
    for seed in range(20, 32):
        sim, fixes, middle = flown(seed)
        error, sigma, _ = at_middle(sim, fixes, middle, barometer(sim, seed))
        z.append(error / sigma)
    low, high = chi2.ppf([0.005, 0.995], len(z))
    assert low < np.sum(np.square(z)) < high


@pytest.mark.slow
def test_heights_that_do_not_follow_the_flight_are_a_contradiction():
    """Oracle: a barometer that wanders by 50 m; accepted it does no harm."""
    sim, fixes, middle = flown(3)
    heights = barometer(sim, 3)
    heights[:, 1] += 50.0 * np.sin(heights[:, 0] / 3.0)
    with pytest.raises(insgnss.InputError, match=r"barometer: \d+ of 180 heights rejected"):
        at_middle(sim, fixes, middle, heights)
    result = insgnss.estimate(
        sim.imu,
        sim.gnss,
        barometer=heights,
        mounting=sim.mounting,
        noise="consumer",
        accept=["barometer"],
    )
    path = result.trajectory
    error = true_height(sim, path.time) - path.height
    assert np.abs(error / np.sqrt(path.cov[:, 2, 2])).max() < 5.0


@pytest.mark.slow
def test_a_flight_file_names_it(tmp_path):
    """Oracle: the same heights as an array; half a second late and in centimetres, which the
    flight file says.
    """
    root = tmp_path / "flight"
    data = insgnss.simulate(
        "ign8", 1.5, directory=root, imu_rate_hz=100.0, seed=5, start_in_air=True
    )
    heights = barometer(data.simulated, 5)
    late = (heights + [0.5, 0.0]) * [1.0, 100.0]
    np.savetxt(root / "barometer.txt", late, fmt="%.6f", header="tow height")
    table = '\n[barometer]\nfile = "barometer.txt"\ntime_offset_s = -0.5\nsigma_m = 0.4\n'
    table += 'units = { length = "cm" }\n'
    data.flight_file.write_text(data.flight_file.read_text() + table)
    flight = insgnss.load_flight(data.flight_file)
    assert root / "barometer.txt" in input_files(flight)
    one = insgnss.process(flight, write=False)
    other = insgnss.process(
        flight.with_(barometer__file=heights, barometer__time_offset_s=0.0), write=False
    )
    assert one.report["counts"]["barometer_heights"] == 90
    np.testing.assert_allclose(one.trajectory.height, other.trajectory.height, rtol=0, atol=1e-5)
    assert one.report["flight"]["barometer"]["sigma_m"] == 0.4


def test_a_barometer_of_another_day_is_refused(tmp_path):
    """Oracle: heights of the day after."""
    sim, fixes, _ = flown(3)
    heights = barometer(sim, 3) + [86400.0, 0.0]
    with pytest.raises(insgnss.InputError, match=r"barometer: heights from .* do not overlap"):
        insgnss.estimate(sim.imu, fixes, barometer=heights, mounting=sim.mounting)
