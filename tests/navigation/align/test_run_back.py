"""The filter run against time: every error state keeps its meaning there."""

from dataclasses import replace

import numpy as np
import pytest
from flown import fly

from insgnss.navigation.align.initial import _run_back
from insgnss.navigation.filter.codes import DRIFT_CODE, TEMPERATURE_CODE
from insgnss.navigation.filter.layout import SlowBias, state_layout
from insgnss.navigation.noise_model.model import AxisNoise, NoiseModel

AXIS = AxisNoise(
    white_noise=1e-4, turn_on_bias=1e-3, drift=1e-5, scale_factor=1e-3, misalignment=1e-3
)


@pytest.fixture(scope="module", params=["decay", "temperature"])
def problem(request):
    """Eight seconds without fixes, by the course of the slow bias."""
    layout = state_layout(
        NoiseModel("test", "", (AXIS,) * 3, (AXIS,) * 3),
        scale_factor=True,
        misalignment=True,
        slow=SlowBias(request.param, 5.0),
    )
    flown = fly(8.0, noise=None, imu_hz=100.0, layout=layout)
    without = flown.problem.epochs._replace(
        has_position=np.zeros(flown.problem.epochs.time.size, dtype=np.bool_),
        temperature=temperature_of(flown.problem.epochs.time),
    )
    return replace(flown.problem, epochs=without), flown.true_nav()


def temperature_of(time):
    """A temperature that changes its direction; between epochs it is a straight line."""
    return 0.3 * np.sin(time / 2.0)


@pytest.mark.parametrize("kind", ["bias", "drift", "slow bias", "scale factor", "from z"])
@pytest.mark.parametrize("sensor", ["gyro", "accel"])
def test_an_error_state_takes_off_what_was_put_into_the_readings(problem, sensor, kind):
    """Oracle: exact motion; readings with a known error, counted from the last epoch, and its state
    lead back to the start.
    """
    given, true = problem
    layout, inc = given.layout, given.inc
    last = inc.marks.size - 1
    s = [str(state) for state in layout.states].index(f"{sensor} x {kind}")
    c, f, x = layout.channel[s], layout.factor[s], np.zeros(layout.size - 9)
    x[s] = {"bias": 1e-2, "slow bias": 1e-2, "drift": 1e-3, "scale factor": 1e-2, "from z": 1e-2}[
        kind
    ]
    since = np.cumsum(inc.dt) - 0.5 * inc.dt - (inc.marks[-1] - inc.marks[0])
    readings = np.hstack([inc.dtheta, inc.dvel])
    if f >= 0:
        # the filter takes x times the reading off, so that the truth is (1 - x) of it, or x of
        # another axis less
        readings[:, c] = (
            readings[:, c] / (1.0 - x[s]) if f == c else readings[:, c] + x[s] * readings[:, f]
        )
    elif f == TEMPERATURE_CODE:
        sums = np.concatenate([[0.0], np.cumsum(inc.dt)])
        readings[:, c] += x[s] * inc.dt * temperature_of(0.5 * (sums[1:] + sums[:-1]))
    else:
        # a slow bias is larger before: exp(-t / 5 s)
        readings[:, c] += (
            x[s] * inc.dt * (since if f == DRIFT_CODE else np.exp(-layout.beta[s] * since))
        )
    spoiled = replace(given, inc=replace(inc, dtheta=readings[:, :3], dvel=readings[:, 3:]))
    P = 1e-12 * np.eye(layout.size)
    back, _, _ = _run_back(spoiled, last, true[last], x, P)
    wrong, _, _ = _run_back(spoiled, last, true[last], np.zeros_like(x), P)
    assert np.abs(back[:6] - true[0, :6]).max() < 2e-3
    assert min(np.abs(back[6:] - true[0, 6:]).max(), np.abs(back[6:] + true[0, 6:]).max()) < 1e-5
    assert np.abs(wrong[:6] - true[0, :6]).max() > 1e-2
