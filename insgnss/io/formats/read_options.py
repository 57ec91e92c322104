"""What the caller states about a recording: options of all readers, in one record."""

from collections.abc import Mapping
from dataclasses import dataclass

from numpy.typing import ArrayLike

from ...records import Quantity
from .text.columns import Columns
from .text.text import Source


@dataclass(frozen=True, kw_only=True)
class ReadOptions:
    """Options of a reader; `READERS` names those that each format takes.

    Attributes
    ----------
    columns : sequence or mapping, optional
        Canonical name of each column of a table, any other name leaving one out; or canonical name
        to the header's name, or to an index, "[1]" for the first.
    units : mapping, optional
        Units of what the format names, each with the value of one count before it where need be;
        a note reports a header's own unit that is another.
    quantity : {"mean_rate", "increments", "instant_rate"}, optional
        What a sample of an IMU is; None for what it usually is in the format.
    gps_week : int, optional
        The week where the file holds none, else the one that it must be of.
    rate_hz : float, optional
        Samples a second, where the file has no column of time; time then starts at zero, and a
        column `counter` (PacketCounter) shows where samples are lost.
    accel_file : path, optional
        The file of the accelerometers, where the samples' file has the gyros alone (`imu.apart`);
        a mapping `columns` names those of both, a sequence those of the gyros, and gx gy gz of it
        are ax ay az of the other file.
    variable : str, optional
        The table inside the file: a variable, a message, a topic.
    repeat_column : str, optional
        Path (or canonical name) of the quantity that changes with each new fix; without it every
        row is a fix, which is refused where the rows repeat each fix until the next.
    sigma_m, sigma_velocity : array_like, optional
        Standard deviations north, east, down, m and m/s, of fixes that state none, or zeros; of an
        autopilot's log in place of its own. Of NMEA `sigma_velocity` takes the velocity of RMC or
        VTG, which is left out without it.
    undulation_m : float, optional
        Geoid above the ellipsoid, m, where heights are above the geoid and the file has none.
    reference : tuple of float, optional
        Latitude, longitude, deg, height, m, from which north, east and down or up count.
    time_scale : str, optional
        "utc", "gpst" or "utc+hh:mm" of dates whose file does not say it.
    """

    columns: Columns = None
    units: Mapping[str, str] | None = None
    quantity: Quantity | None = None
    gps_week: int | None = None
    rate_hz: float | None = None
    accel_file: Source | None = None
    variable: str | None = None
    repeat_column: str | None = None
    sigma_m: ArrayLike | None = None
    sigma_velocity: ArrayLike | None = None
    undulation_m: float | None = None
    reference: tuple[float, float, float] | None = None
    time_scale: str | None = None


ON_COMMAND_LINE = {
    "columns": "--columns",
    "columns [...]": "--columns NAMES",
    "columns {...}": "--columns tow=NAME,gx=NAME,...",
    "units": "--gyro-unit or --accel-unit",
    "units gyro": "--gyro-unit",
    "units accel": "--accel-unit",
}
"""How verbs that take a recording without a flight file call the options of its reader, and what
they ask for in the place of a table of the flight file (`base.wording`).
"""
STATED_NOTHING = ReadOptions()
"""Options of a file that says everything itself."""
