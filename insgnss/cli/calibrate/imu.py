"""`insgnss calibrate imu`: the deterministic calibration of an IMU from static positions."""

import argparse
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from ...base.errors import UsageError
from ...base.inputs import sha256
from ...base.output.staging import together
from ...base.provenance import made_from, refuse_other_results
from ...base.wording import spoken_as
from ...io.options.kinds import Checked
from ...io.options.schema import argument
from ..console import Progress
from ..verb import Message, Verb


@dataclass(frozen=True)
class ImuRequest(Checked):
    """Options of the verb."""

    imu: Path = argument(
        ..., "samples of an IMU that rests for 5 s or more in each position", cli="IMU_FILE"
    )
    flight: Path | None = argument(
        None, "a flight file whose table [imu] states columns, units and quantity", metavar="FLIGHT"
    )
    columns: tuple[str, ...] | Mapping[str, str] | None = argument(
        None, "such as tow,gx,gy,gz,ax,ay,az", usual="by header", kind="columns", metavar="NAMES"
    )
    gyro_unit: str | None = argument(
        None, "rad/s, deg/s or deg/h", usual="by header, else rad/s", metavar="UNIT"
    )
    accel_unit: str | None = argument(
        None, "m/s^2, g or mg", usual="by header, else m/s^2", metavar="UNIT"
    )
    quantity: Literal["mean_rate", "increments", "instant_rate"] | None = argument(
        None, "what a sample is", usual="mean_rate"
    )
    latitude: float | None = argument(
        None,
        "of the place, north positive, for its gravity",
        unit="deg",
        low=-90.0,
        high=90.0,
        usual="9.80665 +- 0.02 m/s^2",
    )
    height: float = argument(0.0, "of the place above the ellipsoid", unit="m")
    out: Path | None = argument(None, "what to write", usual="calibration.toml beside IMU_FILE")
    force: bool = argument(False, "overwrite the calibration of another recording")


def run(options: argparse.Namespace, progress: Progress) -> Message:
    """Do what the parsed command line asks for."""
    from ...io.formats import read_imu
    from ...io.formats.read_options import ON_COMMAND_LINE
    from ...navigation.prepare.calibration import write_calibration
    from ...noise.multi_position.calibration import calibrate_multi_position
    from ...report.document import write_json

    spec = _imu_spec(options)
    out = options.out or options.imu.parent / "calibration.toml"
    document = out.with_suffix(".json")
    if not options.force:
        _refuse_others(out, options.imu)
    refuse_other_results("calibrate imu", document, [options.imu], options.force)
    progress("reading")
    with spoken_as({} if options.flight else ON_COMMAND_LINE):
        imu = read_imu(options.imu, **spec)
    progress("calibrating")
    result = calibrate_multi_position(
        imu, None if options.latitude is None else math.radians(options.latitude), options.height
    )
    notes = [f"note: {note.named_sentence}" for note in imu.notes]
    summary = "\n".join([*notes, result.summary()])
    figures = result.as_dict() | {"file": out, "notes": notes}
    flight = () if options.flight is None else (options.flight,)
    origin = f"of {options.imu.name}, sha256 {sha256(options.imu)}"
    with together():
        write_calibration(result.calibration, out, (*summary.splitlines(), origin))
        write_json(document, figures | made_from((options.imu, *flight), document, [out]))
    return Message(f"{summary}\n{out}\n{document}", figures)


def _refuse_others(out: Path, imu: Path) -> None:
    """Refuse to overwrite the calibration of another recording."""
    if out.is_file() and imu.is_file():
        text = out.read_text(encoding="utf-8", errors="replace")
        if sha256(imu) not in text:
            raise UsageError(
                f"calibrate imu: {out} exists and was not made from {imu}; give another --out,"
                " or --force"
            )


def _imu_spec(options: argparse.Namespace) -> dict[str, Any]:
    """How to read the IMU file: of a flight file, of the options beside it."""
    unit_of = {"gyro": options.gyro_unit, "accel": options.accel_unit}
    units = {sensor: unit for sensor, unit in unit_of.items() if unit}
    spec = {"columns": options.columns, "units": units or None, "quantity": options.quantity}
    if options.flight is None:
        return spec
    if any(spec.values()):
        raise UsageError(
            "calibrate imu: --flight gives columns, units and quantity; remove these options"
        )
    from ...flight.config.load import load_flight

    flight = load_flight(options.flight)
    imu = flight.imu
    return {
        "columns": imu.columns,
        "units": imu.units or None,
        "quantity": imu.quantity,
        "variable": imu.variable,
        "gps_week": flight.gps_week,
    }


VERB = Verb(
    "imu",
    "  insgnss calibrate imu turned_by_hand.csv --latitude 46.57 --height 420 --out navchip1.toml",
    (ImuRequest,),
    run,
)
