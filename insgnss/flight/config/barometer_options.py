"""Table [barometer] of the flight file: heights of a barometer, and how they are weighted."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ...io.options.kinds import Checked
from ...io.options.schema import columns_of_file, option, take_record

if TYPE_CHECKING:
    from ...base.tables import Columns
    from ...records import BarometerHeights


def _unit_keys() -> tuple[str, ...]:
    from ...io.formats.barometer import SPEC

    return tuple(SPEC.units)


@dataclass(frozen=True)
class BarometerInput(Checked, table="barometer"):
    """Table [barometer]; without it none is used.

    In Python `file` may be heights of a barometer, or an array or table of them, instead of a file.

    Raises
    ------
    OptionError
        For a value that cannot be.
    InputError
        Where `file` is neither a path nor heights.
    """

    file: "Path | BarometerHeights" = option(
        ...,
        "file of barometric heights or pressures: text, or the log of ArduPilot or PX4; bias and "
        "scale are estimated",
        kind="file",
    )
    columns: "Columns" = columns_of_file("as gnss.columns", of_file=True)
    units: Mapping[str, str] | None = option(
        None,
        "units of pressure (Pa, hPa, mbar, kPa), length (m, cm, mm) and time (as in imu.units)",
        kind="gnss_units",
        members=_unit_keys,
        usual="by header, else Pa, m and s",
        of_file=True,
    )
    variable: str | None = option(
        None, "message or topic of a log", usual="its first barometer", of_file=True
    )
    time_offset_s: float = option(0.0, "added to the stamps of this sensor", unit="s")
    sigma_m: float = option(
        0.5,
        "standard deviation of white noise of barometric heights at 1 Hz (gusts, propellers)",
        unit="m",
        low=0.01,
        high=100.0,
    )
    bias_sigma_m: float = option(
        10.0,
        "a-priori standard deviation of the bias of barometric heights, once levelled by the fixes",
        unit="m",
        low=0.1,
        high=1000.0,
    )
    bias_walk: float = option(
        0.1,
        "random walk of the bias of barometric heights (weather, temperature, airspeed)",
        unit="m/sqrt(s)",
        low=0.0,
        high=10.0,
    )
    scale_sigma: float = option(
        0.05,
        "a-priori standard deviation of the scale factor of barometric heights; 5 % suits air 14 "
        "K off the standard",
        low=1e-6,
        high=0.5,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        take_record(self, "file", "barometer_heights")
