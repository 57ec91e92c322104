"""Table [[measurement]] of the flight file: a sensor whose values are predicted from the motion."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ...base.received.plugins import installed_plugins
from ...io.options.kinds import check
from ...io.options.schema import Triple, columns_of_file, option

if TYPE_CHECKING:
    from ...base.tables import Columns

ENTRY_POINTS = "insgnss.measurements"
"""Entry points by which an installed package adds kinds."""
SHIPPED = (
    "heading",
    "attitude",
    "body_velocity",
    "baseline",
    "magnetometer",
    "airspeed",
    "position",
)


def _kinds() -> tuple[str, ...]:
    return (*SHIPPED, *installed_plugins(ENTRY_POINTS))


def _unit_keys() -> tuple[str, ...]:
    return ("angle", "velocity", "length", "field", "time")


@dataclass(frozen=True)
class MeasurementInput:
    """Table [[measurement]]; each is one sensor.

    Raises
    ------
    OptionError
        For a value that cannot be.
    """

    kind: str = option(
        ...,
        "quantity that the sensor measures (measurement.md): heading, attitude, body velocity, "
        "baseline from one antenna to another, magnetic field, airspeed or position from a total "
        "station; or a kind of an installed plugin",
        kind="choice",
        choices=_kinds,
    )
    file: Path = option(..., "table of times, values and standard deviations", kind="file")
    name: str | None = option(
        None,
        "name of the sensor in the report, different for every sensor",
        form="text",
        usual="the kind",
    )
    columns: "Columns" = columns_of_file("as gnss.columns", of_file=True)
    units: Mapping[str, str] | None = option(
        None,
        "units of angle (deg, rad), velocity (m/s, cm/s, mm/s, km/h, kn), length (m, cm, mm), "
        "field (uT, nT, mG, G) and time (as in imu.units)",
        kind="gnss_units",
        members=_unit_keys,
        usual="units of the header, else deg, m/s, m, uT and s",
        of_file=True,
    )
    time_offset_s: float = option(0.0, "added to the stamps of this sensor", unit="s")
    sigma: float | None = option(
        None,
        "standard deviation of the values in deg, m/s, m or uT, used if the file has none",
        usual="that of the file",
        low=1e-6,
        high=1e3,
    )
    gate_sigma: float = option(
        5.0,
        "innovation gate: values farther off, in standard deviations, are left out",
        low=2.0,
        high=100.0,
    )
    offset_sigma_deg: float = option(
        2.0,
        "a-priori standard deviation of each estimated angle between sensor and body; 0: 0.05 deg",
        unit="deg",
        low=0.0,
        high=180.0,
    )
    scale_sigma: float = option(
        0.02,
        "a-priori standard deviation of the scale factor of body_velocity or airspeed; 0: 1e-4",
        low=0.0,
        high=0.5,
    )
    axes: str = option(
        "forward right down",
        "body directions of the magnetometer's x, y and z axes, as in imu.axes",
        kind="axes",
    )
    declination_deg: float | None = option(
        None,
        "magnetic declination at place and date of the flight, from a field model (WMM, IGRF), "
        "for a magnetometer",
        unit="deg",
        low=-180.0,
        high=180.0,
    )
    declination_sigma_deg: float = option(
        0.5,
        "a-priori standard deviation of the estimated magnetic declination",
        unit="deg",
        low=0.01,
        high=180.0,
    )
    hard_iron_sigma: float = option(
        2.0,
        "a-priori standard deviation, uT, of the vehicle's estimated constant magnetic field on "
        "each axis; 50 without calibration; 0: none",
        low=0.0,
        high=1e3,
    )
    soft_iron_sigma: float = option(
        0.02,
        "a-priori standard deviation of the magnetometer's nine estimated scale, cross-axis and "
        "alignment factors; 0: none",
        low=0.0,
        high=0.5,
    )
    lever_m: Triple = option(
        (0.0, 0.0, 0.0),
        "lever arm in body axes: for body_velocity and position from the IMU to the measured "
        "point (prism), for baseline from the first antenna to the second",
        unit="m",
    )
    station: Triple | None = option(
        None,
        "latitude and longitude, deg, and ellipsoidal height, m, of the origin of position values",
    )
    station_sigma_m: float = option(
        0.02,
        "a-priori standard deviation of each estimated station coordinate, for position; 0: none",
        unit="m",
        low=0.0,
        high=1e3,
    )
    clock_sigma_s: float = option(
        0.0,
        "a-priori standard deviation of the time offset (stamps early), for position; 0: none",
        unit="s",
        low=0.0,
        high=10.0,
    )

    def __post_init__(self) -> None:
        check(self, "measurement")

    @property
    def called(self) -> str:
        """Its name, or that of its kind."""
        return self.name or self.kind
