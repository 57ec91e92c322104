"""The filter run against time: every error state keeps its meaning there."""

from dataclasses import replace

import numpy as np
import pytest
from flown import fly

from insgnss.navigation.align.initial import _run_back
from insgnss.navigation.filter.codes import DRIFT_CODE
from insgnss.navigation.filter.layout import SlowBias, state_layout
from insgnss.navigation.noise_model.model import AxisNoise, NoiseModel

AXIS = AxisNoise(
    white_noise=1e-4, turn_on_bias=1e-3, drift=1e-5, scale_factor=1e-3, misalignment=1e-3
)


@pytest.fixture(scope="module")
def problem():
    """Eight seconds without fixes."""
    layout = state_layout(
        NoiseModel("test", "", (AXIS,) * 3, (AXIS,) * 3),
        scale_factor=True,
        misalignment=True,
        slow=SlowBias(5.0, 8.0),
    )
    flown = fly(8.0, noise=None, imu_hz=100.0, layout=layout)
    without = flown.problem.epochs._replace(
        has_position=np.zeros(flown.problem.epochs.time.size, dtype=np.bool_)
    )
    return replace(flown.problem, epochs=without), flown.true_nav()


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
