"""Flights whose exposures the receiver stamped: `camera.clock`, all the way to the images."""

import re
from dataclasses import replace

import numpy as np
import pytest

import insgnss
from insgnss.records import ExteriorOrientation


@pytest.fixture(scope="module")
def sim():
    return insgnss.simulate("ign8", 3.0, imu_rate_hz=50.0, seed=52)


def late(sim, by_s: float, **changes):
    """The flight with stamps of fixes and exposures that are late by `by_s`."""
    return insgnss.estimate(
        sim.imu,
        replace(sim.gnss, time=sim.gnss.time + by_s),
        replace(sim.events, time=sim.events.time + by_s),
        mounting=sim.mounting,
        tangent_plane=(
            *np.degrees([sim.tangent_plane.lat, sim.tangent_plane.lon]),
            sim.tangent_plane.height,
        ),
        **changes,
    )


def sigmas(eo: ExteriorOrientation) -> np.ndarray:
    return np.sqrt(np.diagonal(eo.cov, axis1=1, axis2=2))[:, :3]


def of_truth(sim, eo: ExteriorOrientation) -> ExteriorOrientation:
    place = {name: k for k, name in enumerate(sim.truth.eo.images)}
    return sim.truth.eo[np.array([place[name] for name in eo.images])]


def normalised(sim, eo: ExteriorOrientation) -> np.ndarray:
    return (eo.position_m - of_truth(sim, eo).position_m) / sigmas(eo)


def told(result) -> str:
    (sentence,) = [line for line in result.report["history"] if "camera events" in line]
    return sentence


def test_exposures_of_the_receiver_share_the_latency_of_the_fixes(sim):
    """Oracle: the exact motion; stamps 5 ms late, which are known to 10 ms. The time of an image is
    that of its pose on the trajectory.
    """
    result = late(sim, 5e-3, gnss__time_sigma_s=0.01, camera__clock="receiver")
    z = normalised(sim, result.eo)
    assert np.abs(z).max() < 4.0
    assert np.mean(z**2) < 2.5
    # what fixes of 20 to 30 mm leave without any offset is 3 mm; 1 ms of the offset are 12 mm
    assert sigmas(result.eo).max() < 5e-3
    assert "receiver's clock (camera.clock = receiver), moved with the fixes by -" in told(result)
    assert "GNSS positions: of their source; 0 of" in " ".join(result.eo.history)
    (seen,) = [check for check in result.checks if check.name == "unseen constants"]
    assert "GNSS time offset" not in seen.found  # among what the images would suffer from
    true = of_truth(sim, result.eo).time
    offset = result.eo.time - true
    assert np.abs(offset).max() < 2e-3
    assert np.ptp(offset) < 1e-9


@pytest.mark.slow
def test_sigmas_are_as_small_as_without_an_offset_and_the_other_clock_contradicts(sim):
    """Oracle: the flight with exact stamps; the exact motion, which events of the IMU's clock miss
    by 5 ms, 60 mm.
    """
    exact = late(sim, 0.0, gnss__time_sigma_s=0.0)
    of_receiver = late(sim, 5e-3, gnss__time_sigma_s=0.01, camera__clock="receiver")
    assert np.abs(sigmas(of_receiver.eo) / sigmas(exact.eo) - 1.0).max() < 0.05
    assert told(exact) == "camera events on the IMU's clock (camera.clock = auto)"
    of_imu = late(sim, 5e-3, gnss__time_sigma_s=0.01)
    assert np.abs(normalised(sim, of_imu.eo)).max() > 6.0
    assert (sigmas(of_imu.eo).max(axis=1) > 1.5 * sigmas(exact.eo).max(axis=1)).all()


@pytest.mark.slow
def test_exposures_move_with_fixes_whose_stamps_are_moved(sim):
    """Oracle: the exact motion; 12 ms of latency go into the stamps of fixes and exposures, or are
    stated beforehand.
    """
    options = insgnss.FilterOptions(time_offset=True)
    estimated = late(sim, 0.012, filter_options=options, camera__clock="receiver")
    stated = late(sim, 0.012, gnss__time_offset_s=-0.012, camera__clock="receiver")
    assert "time stamps of the fixes moved by -0.01" in " ".join(estimated.report["history"])
    for result in (estimated, stated):
        assert np.abs(normalised(sim, result.eo)).max() < 4.0
        assert np.abs(result.eo.time - of_truth(sim, result.eo).time).max() < 3e-3


@pytest.mark.slow
def test_the_clock_of_the_exposures_is_asked_for_where_it_matters(sim):
    """Oracle: the exact motion; exposures that the receiver stamped 20 ms late, taken as the IMU's,
    are off by what the note says, which stands out. Who says the clock is not asked, nor who has
    one clock.
    """

    def asked(by_s, **changes):
        result = late(sim, by_s, gnss__time_offset_s=-by_s, **changes)
        of_clock = [one for one in result.report["limits"] if "exposure clock" in one["text"]]
        assert all(one["rank"] > 1.0 for one in of_clock)
        assert len(of_clock) == sum(c.name == "exposure clock" for c in result.checks)
        return [c for c in result.checks if c.name == "exposure clock"], result.eo

    (check,), eo = asked(0.02)
    off = np.linalg.norm(eo.position_m - of_truth(sim, eo).position_m, axis=1).max()
    stated = float(re.search(r"up to (\S+) m", check.found)[1])
    assert stated == pytest.approx(off, abs=0.02)
    assert off > 0.15
    assert asked(0.02, camera__clock="imu")[0] == []
    assert asked(0.02, camera__clock="receiver")[0] == []
    assert asked(0.0)[0] == []
