"""Names of error states as reports and files have printed them since the first release."""

import pytest

from insgnss.records.states import (
    CLOCK_RATE,
    MISALIGNMENT,
    OF_LEVER_ARM,
    SCALE_FACTOR,
    TIME_OFFSET,
    State,
)
from insgnss.records.verdicts import Estimate

NAMES = {
    OF_LEVER_ARM[1]: "antenna lever arm right",
    TIME_OFFSET: "GNSS time offset",
    CLOCK_RATE: "GNSS clock rate",
    State("bias", "x", "rad/s", "gyro"): "gyro x bias",
    State(SCALE_FACTOR, "z", "", "accel"): "accel z scale factor",
    State(MISALIGNMENT, "x from y", "rad", "gyro"): "gyro x from y",
}


@pytest.mark.parametrize(("state", "name"), NAMES.items())
def test_a_state_is_printed_by_its_name(state: State, name: str) -> None:
    """Oracle: report.json of the first release."""
    assert str(state) == name
    assert Estimate(state, 0.01, 0.002, 0.2).name == name


def test_the_states_of_all_axes_have_one_name() -> None:
    """Oracle: the history of a run of the first release."""
    gyro = State(SCALE_FACTOR, "y", "", "gyro").of_all_axes
    accel = State(MISALIGNMENT, "x from y", "rad", "accel").of_all_axes
    assert (str(gyro), str(accel)) == ("gyro scale factors", "accelerometer misalignments")
    assert gyro == State(SCALE_FACTOR, "x", "", "gyro").of_all_axes
