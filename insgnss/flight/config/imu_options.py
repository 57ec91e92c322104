"""Table [imu] of the flight file: the samples of an IMU, how they are read, and its noise."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...base.errors import OptionError, near
from ...io.options.kinds import Checked, OptionKind, other_class, register
from ...io.options.schema import Declared, Triple, Words, columns_of_file, option, take_record

if TYPE_CHECKING:
    from ...base.tables import Columns
    from ...navigation.noise_model.noise_model import NoiseModel
    from ...records import Array, ImuSamples, Quantity


def _quantities() -> Words:
    from ...records import QUANTITIES

    return QUANTITIES


def _imu_unit_keys() -> tuple[str, ...]:
    from ...io.formats.imu.imu_csv import SPEC

    return tuple(SPEC.units)


def neither_model_nor_file(noise: str, remark: str = "") -> str:
    """What is wrong with a text that should name a noise model."""
    from ...navigation.noise_model.model import shipped_models

    advice = near(noise, shipped_models())
    return f"{noise!r} is neither a shipped model nor a file{remark}; {advice}"


def _name_or_path(item: Declared, value: Any) -> Any:
    """A text that names a file and no shipped model as a path, all else as it is."""
    from ...navigation.noise_model.model import shipped_models

    named = isinstance(value, str) and value not in shipped_models() and Path(value).is_file()
    return Path(value) if named else value


def _no_noise(item: Declared, value: Any) -> str:
    from ...navigation.noise_model.model import shipped_models

    if not isinstance(value, str):
        return other_class(item.type, value)
    return "" if value in shipped_models() else neither_model_nor_file(value)


def _refuse_units(units: Mapping[str, str], quantity: str) -> None:
    """Raise OptionError for a unit that is none of its quantity's, and say whose it is."""
    from ...io.formats import SENSOR_SCALES
    from ...io.formats.text.units import imu_kinds, is_unit

    kinds = dict(zip(("gyro", "accel"), imu_kinds(quantity), strict=True))
    for sensor, unit in units.items():
        kind = kinds.get(sensor, sensor)
        if is_unit(unit, kind):
            continue
        count = "for counts write the value of one count (0.05 deg/s)"
        advice = f"{near(str(unit), tuple(SENSOR_SCALES[kind]))}; {count}"
        homes = [name for name in SENSOR_SCALES if is_unit(unit, name)]
        if kind.partition(" ")[0] in [name.partition(" ")[0] for name in homes]:
            advice = (
                f'{unit} does not belong to quantity = "{quantity}"; use'
                f" {', '.join(SENSOR_SCALES[kind])}"
            )
        elif homes:
            advice = f"{unit} belongs to the other sensor; use {', '.join(SENSOR_SCALES[kind])}"
        raise OptionError(f"imu.units.{sensor}", f"{unit!r} is no unit for it: {advice}")


register("noise", OptionKind(_no_noise, _name_or_path))


@dataclass(frozen=True)
class ImuInput(Checked, table="imu"):
    """Table [imu]; `noise` is the name of a shipped model or the path of a file.

    `units` has the keys gyro, accel and time as far as they are given, and is None without any.
    In Python `file` may be samples, or an array or table of them (see `insgnss.estimate`), and
    `noise` a noise model; columns, units, variable and rate_hz, which say how to read a file, are
    then not looked at, and `Flight.with_` refuses them.

    Raises
    ------
    OptionError
        For a value that cannot be.
    InputError
        Where `file` is neither a path nor samples.
    """

    file: "Path | ImuSamples" = option(..., "file of the IMU samples", kind="file")
    accel_file: Path | None = option(
        None,
        "text file of the accelerometers, needed if `file` holds only the gyros; both on one "
        "clock, `columns` and `units` are for both",
        of_file=True,
    )
    columns: "Columns" = columns_of_file(
        'columns of the file: list of names, or table { canonical = "name in the file" }',
        of_file=True,
    )
    units: Mapping[str, str] | None = option(
        None,
        "units of gyro (rad/s, deg/s, mdeg/s, deg/h; increments: rad, deg, arcsec), accel (m/s^2, "
        "g, mg, ug; increments: m/s, g\\*s, mg\\*s, ug\\*s) and time (s, ms, us, ns, unix, gps); "
        'a number before the unit is the value of one count ("0.05 deg/s")',
        kind="units",
        members=_imu_unit_keys,
        usual="by header (imu_csv.md), else SI",
        of_file=True,
    )
    quantity: "Quantity" = option(
        "mean_rate",
        "quantity of a sample: mean rate or increment over the interval that ends at the time "
        "stamp, or instantaneous rate at the time stamp",
        kind="choice",
        choices=_quantities,
        of_file=True,
    )
    axes: str = option("forward right down", "body directions of the IMU's x, y and z", kind="axes")
    noise: "str | Path | NoiseModel" = option(
        "navchip", "name of a noise model of insgnss, or path of a noise-model file", kind="noise"
    )
    time_offset_s: float = option(0.0, "added to the stamps of this sensor", unit="s")
    variable: str | None = option(None, "struct or table inside a MATLAB file", of_file=True)
    rate_hz: float | None = option(
        None,
        "sampling rate, for a file without time; time then begins at 0",
        unit="Hz",
        low=1.0,
        high=1e5,
        of_file=True,
    )
    accel_sign: float = option(
        1.0,
        "sign of the accelerometers: 1 for the specific force (up at rest), -1 for its reverse",
        kind="sign",
        form="1 or -1",
    )
    calibration: Path | None = option(
        None,
        "file of bias, scale and non-orthogonality in the IMU's axes (`insgnss calibrate`,"
        " imu_calibration.md)",
    )
    lever_m: Triple = option(
        (0.0, 0.0, 0.0),
        "lever arm from the first IMU to this one, in body axes",
        unit="m",
        only="imu.further",
    )
    further: "tuple[ImuInput, ...]" = option(
        (),
        "`[[imu.further]]`, further IMUs on the same body, combined with this one: the keys of"
        " [imu], and `lever_m`",
        kind="tables",
        form="tables",
        only="imu",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.units:
            _refuse_units(self.units, self.quantity)
        take_record(self, "file", "imu_samples", self.quantity)

    @property
    def C_b_imu(self) -> "Array":
        """(3, 3), IMU axes to body forward-right-down."""
        from ...geodesy.axes import parse_axes

        return parse_axes(self.axes)
