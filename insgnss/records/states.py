"""The error states of the filter as records: what they are of, along which axis, in which unit.

Whoever decides by a state compares its fields; its name is for people and files only.
"""

from dataclasses import dataclass, replace

AXES = ("forward", "right", "down")
LEVER_ARM, SCALE_FACTOR, MISALIGNMENT = "antenna lever arm", "scale factor", "misalignment"
CORRELATED_ERROR = "GNSS time-correlated error"
UNFIXED_ERROR = "GNSS unfixed time-correlated error"
VELOCITY_ERROR = "GNSS velocity time-correlated error"
BAROMETER_BIAS = "barometer bias"
CHANNELS = tuple((sensor, axis) for sensor in ("gyro", "accel") for axis in "xyz")


@dataclass(frozen=True)
class State:
    """An error state of the filter, or all states of one kind that a sensor has.

    Parameters
    ----------
    group : str
        What it is an error of, such as "antenna lever arm", or of the IMU "scale factor".
    axis : str
        Its axis; of a misalignment that of the channel and the other one, "x from y". Empty where
        there is one axis only, and of an IMU for the states of all axes.
    unit : str
        SI unit, or empty of a ratio.
    sensor : str
        "gyro" or "accel" of an error of the IMU, else empty.
    """

    group: str
    axis: str = ""
    unit: str = ""
    sensor: str = ""

    def __str__(self) -> str:
        if not self.sensor:
            return f"{self.group} {self.axis}".rstrip()
        if not self.axis:
            return f"{'gyro' if self.sensor == 'gyro' else 'accelerometer'} {self.group}s"
        channel = f"{self.sensor} {self.axis}"
        return channel if self.group == MISALIGNMENT else f"{channel} {self.group}"

    @property
    def of_all_axes(self) -> "State":
        """The same error of all axes."""
        return replace(self, axis="")


# of gyros whose axes define those of the body, the lower triangle: three more would turn all axes
# of the IMU alike, as a bore-sight does, and no flight shows that
OF_GYROS = tuple(
    State(MISALIGNMENT, axis, "rad", "gyro") for axis in ("y from x", "z from x", "z from y")
)
OF_LEVER_ARM = tuple(State(LEVER_ARM, axis, "m") for axis in AXES)
TIME_OFFSET, CLOCK_RATE = State("GNSS time offset", unit="s"), State("GNSS clock rate")
OF_FIXES = (*OF_LEVER_ARM, TIME_OFFSET, CLOCK_RATE)
