"""The receiver on an exact motion: statistics of its errors, outages, outliers, latency, episodes
of another quality.
"""

import numpy as np
import pyproj
import pytest
from numpy.testing import assert_allclose
from scipy.stats import chi2
from surveys import block_flight

from insgnss.base.errors import UsageError
from insgnss.io.formats.gnss.gnss_text import read_gnss_text, write_gnss_text
from insgnss.records.qualities import Quality
from insgnss.simulation.raw_gnss.receiver import FixEpisode, GnssOptions, simulate_gnss
from insgnss.simulation.sensors import Rig, antenna_states

TOPOCENTRIC = pyproj.Transformer.from_pipeline(
    "+proj=pipeline +step +proj=cart +ellps=WGS84 +step +proj=topocentric +ellps=WGS84 +lat_0=46.57"
    " +lon_0=6.54 +h_0=0"
)
EXACT = {"sigma_m": (1e-6, 1e-6, 1e-6)}


@pytest.fixture(scope="module")
def flight():
    return block_flight(10.0, start_in_air=True, seed=2)


def ned(lat, lon, h):
    east, north, up = TOPOCENTRIC.transform(np.degrees(lon), np.degrees(lat), h)
    return np.stack([north, east, -up], axis=-1)


def same(variance, expected, n):
    """Whether a sample variance of n values lies in the 99.9 % interval of chi-square."""
    low, high = chi2.ppf([0.0005, 0.9995], n) / n
    return low < variance / expected < high


def fixes_of(flight, **options):
    return simulate_gnss(flight, Rig(), GnssOptions(**options), np.random.default_rng(0))[0]


def off_the_truth(flight, fixes, at):
    """Errors north, east, down (n, 3) against the antenna at `at`, by pyproj."""
    truth, _ = antenna_states(flight.motion, Rig().antenna_lever_b, at)
    return ned(fixes.lat, fixes.lon, fixes.height) - ned(
        *flight.motion.frame.geodetic_from_position(truth)
    )


def residuals(flight, options, seed=0):
    """Errors north, east, down (n, 3), by pyproj in the tangent plane (its north is that of the
    site to 2e-4), and the fixes.
    """
    fixes, outlier = simulate_gnss(flight, Rig(), options, np.random.default_rng(seed))
    return off_the_truth(flight, fixes, fixes.time), fixes, outlier


def test_fixes_scatter_as_they_claim(flight):
    """Oracle: chi-square bounds of the sample variance, white by its first autocorrelation."""
    error, fixes, outlier = residuals(flight, GnssOptions(sigma_m=(0.02, 0.025, 0.05)))
    assert fixes.time.size == 6001
    assert_allclose(np.diff(fixes.time), 0.1, atol=1e-9)
    for k, sigma in enumerate((0.02, 0.025, 0.05)):
        assert same((error[:, k] ** 2).mean(), sigma**2, 6001)
        assert_allclose(fixes.cov_ned[:, k, k], sigma**2)
        assert abs(np.corrcoef(error[1:, k], error[:-1, k])[0, 1]) < 4 / np.sqrt(6000)
    assert not outlier.any()


def test_correlated_errors_have_their_correlation_time(flight):
    """Oracle: autocorrelation exp(-lag/T) of a Gauss-Markov process, variance sum of both; 600 s
    hold 300 times T, hence 25 %.
    """
    error, fixes, _ = residuals(
        flight,
        GnssOptions(
            sigma_m=(1e-4,) * 3, correlated_sigma_m=(0.03, 0.0, 0.05), correlation_time_s=2.0
        ),
    )
    for k, sigma in ((0, 0.03), (2, 0.05)):
        assert error[:, k].std() == pytest.approx(sigma, rel=0.2)
        assert np.corrcoef(error[20:, k], error[:-20, k])[0, 1] == pytest.approx(
            np.exp(-1.0), abs=0.2
        )
        assert fixes.cov_ned[0, k, k] == pytest.approx(sigma**2 + 1e-8)
    assert error[:, 1].std() == pytest.approx(1e-4, rel=0.05)


def test_outliers_are_as_many_and_as_large_as_asked(flight):
    """Oracle: binomial share (3.5 sigma) and the range of sizes."""
    error, _, outlier = residuals(
        flight, GnssOptions(sigma_m=(1e-3,) * 3, outlier_fraction=0.05, outlier_m=(1.0, 4.0))
    )
    assert outlier.mean() == pytest.approx(0.05, abs=0.01)
    size = np.linalg.norm(error, axis=1)
    assert size[~outlier].max() < 0.01
    assert 0.99 < size[outlier].min() < 1.1
    assert 3.8 < size[outlier].max() < 4.01


def test_outages_take_fixes_and_nothing_else(flight):
    """Oracle: the clock; the fixes that stay are those of the run without outages."""
    options = GnssOptions(outages=((100.0, 20.0), (300.0, 5.0)))
    _, whole, _ = residuals(flight, GnssOptions())
    _, fixes, outlier = residuals(flight, options)
    assert fixes.time.size == outlier.size == 6001 - 250
    gaps = np.diff(fixes.time)
    assert_allclose(gaps[gaps > 0.15], [20.1, 5.1], atol=1e-6)
    assert np.isin(fixes.lat, whole.lat).all()
    with pytest.raises(UsageError, match="no fix"):
        residuals(flight, GnssOptions(outages=((0.0, 1e4),)))


def test_velocities_scatter_as_they_claim(flight):
    """Oracle: chi-square bounds about the derivative of the true antenna position."""
    _, fixes, _ = residuals(flight, GnssOptions(velocity_sigma_ms=(0.03, 0.04, 0.05), phase_s=0.03))
    inner = fixes.time[1:-1]
    assert_allclose(fixes.time * 10 % 1.0, 0.3, atol=1e-5)
    ahead, behind = (
        antenna_states(flight.motion, Rig().antenna_lever_b, inner + e)[0] for e in (1e-3, -1e-3)
    )
    error = fixes.velocity_ned[1:-1] - (ahead - behind) / 2e-3
    for k, sigma in enumerate((0.03, 0.04, 0.05)):
        assert same((error[:, k] ** 2).mean(), sigma**2, inner.size)
        assert_allclose(fixes.velocity_cov_ned[:, k, k], sigma**2)


@pytest.mark.parametrize("latency", [0.0, -0.3, 0.02, 0.137, -18.0])
def test_a_fix_belongs_to_its_stamp_less_the_latency(flight, latency):
    """Oracle: pyproj and the exact antenna at stamp - latency; stamps stay on the receiver's grid,
    10 micrometres.
    """
    fixes = fixes_of(flight, latency_s=latency, **EXACT)
    at = fixes.time - latency
    assert_allclose(fixes.time * 10 - np.round(fixes.time * 10), 0.0, atol=1e-5)
    assert at.min() >= flight.motion.start - 1e-9
    assert at.max() <= flight.motion.end + 1e-9
    assert fixes.time.size in (6000, 6001)
    assert np.abs(off_the_truth(flight, fixes, at)).max() < 1e-5


def test_velocities_are_late_as_well(flight):
    """Oracle: the run without latency, whose fix half an interval earlier is the same instant."""
    prompt = fixes_of(flight, velocity_sigma_ms=(1e-9,) * 3, phase_s=0.05, **EXACT)
    late = fixes_of(flight, velocity_sigma_ms=(1e-9,) * 3, latency_s=0.05, **EXACT)
    common = np.isin(np.round(late.time - 0.05, 6), np.round(prompt.time, 6))
    assert_allclose(late.velocity_ned[common][:5900], prompt.velocity_ned[:5900], atol=1e-6)


def test_an_episode_has_its_own_error_claim_and_quality(flight):
    """Oracle: counting, the exact antenna, and the sample variance: 100 s hold 20 times 5 s, hence
    50 %.
    """
    stretches = (
        FixEpisode(100.0, 100.0, Quality.FLOAT, (0.3, 0.3, 0.5), 5.0),
        FixEpisode(300.0, 100.0, Quality.SINGLE, (2.0, 2.0, 4.0), 5.0, (0.02, 0.02, 0.03)),
    )
    fixes = fixes_of(flight, episodes=stretches)
    elapsed = fixes.time - flight.motion.start
    error = off_the_truth(flight, fixes, fixes.time)
    for start, code, sigma, claim in (
        (100.0, Quality.FLOAT, (0.3, 0.3, 0.5), (0.3, 0.3, 0.5)),
        (300.0, Quality.SINGLE, (2.0, 2.0, 4.0), (0.02, 0.02, 0.03)),
    ):
        here = (elapsed >= start - 1e-6) & (elapsed < start + 100.0 - 1e-6)
        assert here.sum() == 1000
        assert (fixes.quality[here] == code).all()
        assert_allclose(error[here].std(axis=0), sigma, rtol=0.5)
        assert_allclose(
            np.sqrt(np.diagonal(fixes.cov_ned[here], axis1=1, axis2=2)),
            np.broadcast_to(claim, (1000, 3)),
        )
        assert np.corrcoef(error[here][1:, 0], error[here][:-1, 0])[0, 1] > 0.95
    rest = fixes.quality == 1
    assert rest.sum() == 4001
    assert np.abs(error[rest]).max() < 0.15
    assert fixes_of(flight).quality is None


def test_an_episode_of_no_correlation_is_white(flight):
    """Oracle: first autocorrelation of 3000 white values, four sigma."""
    fixes = fixes_of(flight, episodes=(FixEpisode(100.0, 300.0, correlation_time_s=0.0),))
    here = fixes.quality == Quality.FLOAT
    error = off_the_truth(flight, fixes, fixes.time)[here]
    assert abs(np.corrcoef(error[1:, 1], error[:-1, 1])[0, 1]) < 4.0 / np.sqrt(3000)


def test_a_correlated_error_can_go_unclaimed(flight):
    """Oracle: the options; errors are the same, claims are with and without the correlated part."""
    options = {"sigma_m": (0.01, 0.01, 0.02), "correlated_sigma_m": (0.03, 0.0, 0.05)}
    told, untold = fixes_of(flight, **options), fixes_of(flight, **options, claim_correlated=False)
    assert np.array_equal(told.lat, untold.lat)
    assert_allclose(np.diagonal(told.cov_ned[0]), [0.0010, 0.0001, 0.0029])
    assert_allclose(np.diagonal(untold.cov_ned[0]), [0.0001, 0.0001, 0.0004])


def test_the_quality_gets_through_a_file(flight, tmp_path):
    """Oracle: the fixes that were written, read back."""
    fixes = fixes_of(flight, episodes=(FixEpisode(100.0, 10.0),), rate_hz=1.0)
    write_gnss_text(fixes, tmp_path / "fixes.txt")
    assert np.array_equal(read_gnss_text(tmp_path / "fixes.txt").quality, fixes.quality)


@pytest.mark.parametrize(
    "wrong", [{"duration_s": 0.0}, {"sigma_m": (0.0, 1.0, 1.0)}, {"correlation_time_s": -1.0}]
)
def test_an_episode_that_is_none_is_refused(wrong):
    """Oracle: the contract."""
    with pytest.raises(UsageError, match="must be positive"):
        FixEpisode(**{"start_s": 1.0, "duration_s": 1.0, **wrong})
