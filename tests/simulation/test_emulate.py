"""Flights emulated from sampled trajectories: the spline is the truth, and everything that follows
from it.
"""

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from emulate import Emulation, add_recorded_noise, emulate_motion
from flown import error_of
from numpy.testing import assert_allclose
from oracles import oracle
from scipy.stats import chi2
from surveys import block_flight

from insgnss import load_flight
from insgnss.base.errors import InputError, UsageError
from insgnss.flight.processing.pipeline import process
from insgnss.geodesy.rotation import (
    quaternion_from_rotation,
    rpy_from_rotation,
    vector_from_rotation,
)
from insgnss.navigation.filter.strapdown import free_inertial
from insgnss.navigation.noise_model.model import AxisNoise, GaussMarkov, NoiseModel
from insgnss.navigation.prepare.increments import body_increments
from insgnss.simulation.dataset import write_simulated
from insgnss.simulation.scenario import observe
from insgnss.simulation.sensors import ImuOptions

DATA = Path(__file__).parents[3] / "shared" / "data"
START = 205200.0


def sampled(minutes: float = 1.0, noise_m: float = 0.002, noise_rad: float = 2e-4):
    """A block flight as a 100 Hz table of poses with the noise that such tables have: (arguments of
    emulate_motion, motion).
    """
    motion = block_flight(minutes, start_in_air=True, seed=11, line_length_m=150.0).motion
    time = np.arange(motion.start, motion.end, 0.01)
    rng = np.random.default_rng(1)
    lat, lon, height = motion.geodetic(time)
    rpy = rpy_from_rotation(
        motion.C_nl(time) @ motion.C_lb(time)
    ) + noise_rad * rng.standard_normal((time.size, 3))
    north = noise_m / 6.4e6 * rng.standard_normal(time.size)
    return (time, lat + north, lon, height + noise_m * rng.standard_normal(time.size), rpy), motion


@pytest.fixture(scope="module")
def emulation() -> Emulation:
    return emulate_motion(*sampled()[0])


def recorded_track(number: int) -> Emulation:
    """A trajectory of the EPFL drone, 100 Hz; not shipped."""
    file = DATA / "epfl_uav_trajectories" / f"example_{number}_traj_ellipsoidal.RData"
    if not file.is_file():
        pytest.skip(f"the trajectory {file.name} is not here")
    rdata = oracle("rdata")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of rdata, about attributes that it does not know
        (table,) = rdata.read_rda(file).values()
    t, lat, lon, height, *rpy = np.asarray(table, dtype=np.float64).T
    return emulate_motion(START + t, lat, lon, height, np.stack(rpy, axis=-1))


def test_the_spline_follows_what_was_sampled(emulation):
    """Oracle: the exact motion behind the samples, whose noise the fit averages: 2 mm and 0.2 mrad
    over 20 samples a knot interval.

    A quintic with knots every 0.2 s also follows the gusts of this flight (0.12 s wide, half a
    degree) to some tenths of a degree.
    """
    _, motion = sampled()
    time = np.linspace(emulation.motion.start, emulation.motion.end, 500)
    here = emulation.motion.frame
    apart = here.position_from_geodetic(*motion.geodetic(time)) - emulation.motion.position(time)
    assert np.sqrt((apart**2).mean(axis=0)).max() < 0.02
    turn = vector_from_rotation(
        emulation.motion.C_nl(time)
        @ emulation.motion.C_lb(time)
        @ np.swapaxes(motion.C_nl(time) @ motion.C_lb(time), -1, -2)
    )
    assert np.sqrt((turn**2).mean(axis=0)).max() < np.radians(0.3)
    assert emulation.position_rms_m.max() < 0.02
    assert emulation.attitude_rms_rad.max() < np.radians(0.3)


def test_a_spline_is_given_back():
    """Oracle: a motion of the same knots, sampled without noise; least squares reproduces what lies
    in its space.
    """
    motion = block_flight(0.5, start_in_air=True, seed=11).motion
    time = motion.start + np.arange(0.0, motion.end - motion.start, 0.01)
    args = (time, *motion.geodetic(time), rpy_from_rotation(motion.C_nl(time) @ motion.C_lb(time)))
    again = emulate_motion(*args, knot_s=motion.spacing)
    at = np.linspace(again.motion.start + 0.5, again.motion.end - 0.5, 200)
    apart = again.motion.frame.position_from_geodetic(*motion.geodetic(at)) - again.motion.position(
        at
    )
    assert np.abs(apart).max() < 1e-6
    C = (
        again.motion.C_nl(at)
        @ again.motion.C_lb(at)
        @ np.swapaxes(motion.C_nl(at) @ motion.C_lb(at), -1, -2)
    )
    assert (
        np.abs(vector_from_rotation(C)).max() < 1e-7
    )  # the axes of the two local frames differ, the angles are splines in one only
    assert again.position_rms_m.max() < 1e-6


@pytest.mark.parametrize("track", [0, 1, 3])
def test_free_inertial_navigation_reproduces_the_emulated_flight(track):
    """Oracle: the spline, which is the truth; error-free samples at 200 Hz, a millimetre over one
    to three minutes.
    """
    motion = (emulate_motion(*sampled()[0]) if track == 0 else recorded_track(track)).motion
    imu = motion.imu(200.0)
    inc = body_increments(imu, np.eye(3), imu.time[::200])
    truth = np.hstack(
        [
            motion.position(inc.marks),
            motion.velocity(inc.marks),
            quaternion_from_rotation(motion.C_lb(inc.marks)),
        ]
    )
    error = error_of(free_inertial(inc, motion.frame, truth[0]), truth)
    assert np.abs(error[:, :3]).max() < 1e-3
    assert np.abs(error[:, 6:]).max() < 1e-7


def squares(simulated, directory, **options) -> tuple[np.ndarray, int]:
    """Normalised error squared (6 degrees of freedom) of one image in the middle of each third of a
    flight, processed from its files.
    """
    data = write_simulated(directory, simulated, **options)
    eo, truth = process(load_flight(data.flight_file)).eo, simulated.truth.eo
    k = (np.array([1, 3, 5]) * len(eo.images)) // 6
    at = [truth.images.index(eo.images[i]) for i in k]
    turn = vector_from_rotation(truth.C_mc[at] @ np.swapaxes(eo.C_mc[k], -1, -2))
    error = np.hstack([truth.position_m[at] - eo.position_m[k], turn])
    return np.einsum("ni,ni->n", error, np.linalg.solve(eo.cov[k], error[..., None])[..., 0])


def assert_consistent(values: list[np.ndarray]) -> None:
    """Two-sided 99.9 % bounds of chi-square for the mean of a flight's images, taken as one image
    (which is wider than the truth).
    """
    total = sum(part.mean() for part in values)
    low, high = chi2.ppf([0.0005, 0.9995], 6 * len(values))
    assert low < total < high, f"{total:.1f} outside {low:.1f} to {high:.1f}"


@pytest.mark.slow
def test_emulated_errors_are_as_large_as_their_sigmas(emulation, tmp_path):
    """Oracle: chi-square bounds over four realisations of Table 5 noise on one emulated flight."""
    flight = emulation.flight()
    found = [
        squares(observe(flight, seed, imu=ImuOptions(100.0)), tmp_path / str(seed))
        for seed in range(4)
    ]
    assert_consistent(found)


@pytest.mark.slow
def test_recorded_trajectories_with_table_5_noise(tmp_path):
    """Oracle: chi-square bounds over the trajectories at hand."""
    found = [
        squares(observe(recorded_track(k).flight(), k, imu=ImuOptions(100.0)), tmp_path / str(k))
        for k in (1, 2, 3)
    ]
    assert_consistent(found)


def test_recorded_noise_is_added_row_by_row():
    """Oracle: addition; increments take the noise times the interval."""
    motion = block_flight(0.2, start_in_air=True, seed=1).motion
    noise = np.random.default_rng(0).standard_normal((5000, 6)) * 1e-3
    for quantity, unit in (("mean_rate", 1.0), ("increments", 0.01)):
        clean = motion.imu(100.0, quantity)
        noisy = add_recorded_noise(clean, noise, first=7)
        n = clean.time.size
        assert_allclose(noisy.gyro - clean.gyro, unit * noise[7 : 7 + n, :3], atol=1e-12)
        assert_allclose(noisy.accel - clean.accel, unit * noise[7 : 7 + n, 3:], atol=1e-12)
    for wrong in ({"first": 4000}, {"first": -1}):
        with pytest.raises(UsageError, match="rows"):
            add_recorded_noise(clean, noise, **wrong)
    with pytest.raises(UsageError, match="whole sample intervals"):
        add_recorded_noise(motion.imu(100.0, "instant_rate"), noise)


ADIS = NoiseModel(
    "adis16405",
    "Allan deviation of the recordings: at 1 s the white noise, at 100 s over 0.62 the Gauss-Markov"
    " process of 100 s",
    (AxisNoise(white_noise=7.5e-4, gauss_markov=(GaussMarkov.from_sigma(100.0, 2.3e-4),)),) * 3,
    (AxisNoise(white_noise=6.5e-3, gauss_markov=(GaussMarkov.from_sigma(100.0, 5.5e-3),)),) * 3,
)


@pytest.mark.slow
def test_recorded_static_noise_on_a_recorded_trajectory(tmp_path):
    """Oracle: chi-square bounds; the noise is that of a real ADIS16405 at rest, six stretches of
    its own recordings.
    """
    files = [DATA / "adis16405_static" / f"adis_16405_imu{k}.npy" for k in (1, 2, 3, 5)]
    if not files[0].is_file():
        pytest.skip("the recordings adis16405_static are not here")
    flight = recorded_track(2).flight()
    found = []
    for k, file in enumerate(files):
        counts = np.load(file, mmap_mode="r")[200_000 : 200_000 + 12_000].astype(np.float64)
        noise = (counts - counts.mean(axis=0)) * ([np.radians(0.05)] * 3 + [0.00333 * 9.80665] * 3)
        simulated = observe(flight, k, imu=ImuOptions(100.0, None))
        simulated = replace(
            simulated,
            imu=add_recorded_noise(simulated.imu, noise),
            imu_options=ImuOptions(100.0, ADIS),
        )
        found.append(squares(simulated, tmp_path / str(k)))
    assert_consistent(found)


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        (
            lambda a: (np.where(np.arange(a[0].size) == 500, START, a[0]), *a[1:]),
            InputError,
            "time must increase",
        ),
        (lambda a: tuple(v[::30] for v in a), InputError, "denser samples"),
        (lambda a: (*a[:4], a[4] + [0.0, 1.5, 0.0]), InputError, "pitch"),
        (lambda a: tuple(v[:100] for v in a), UsageError, "times in it"),
    ],
)
def test_what_cannot_be_emulated_is_refused(change, error, words):
    """Oracle: the contract; the message names sample or value."""
    with pytest.raises(error, match=words):
        emulate_motion(*change(sampled(0.2)[0]))


def test_an_exposure_interval_must_be_positive(emulation):
    """Oracle: the contract."""
    with pytest.raises(UsageError, match="positive"):
        emulation.flight(every_s=0.0)
