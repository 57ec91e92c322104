"""`insgnss calibrate imu`: the deterministic calibration of an IMU from static positions."""

import argparse
import math
from pathlib import Path
from typing import Any

from ...base.errors import UsageError
from ...base.inputs import sha256
from ...base.output.staging import together
from ...base.provenance import made_from, refuse_other_results
from ..console import Progress
from ..verb import Verb, show


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    parser.add_argument(
        "imu",
        type=Path,
        metavar="IMU_FILE",
        help="samples of an IMU that rests 5 s and more in each position",
    )
    parser.add_argument(
        "--flight",
        type=Path,
        metavar="FLIGHT",
        help="a flight file whose [imu] says columns, units and quantity",
    )
    parser.add_argument(
        "--columns", metavar="NAMES", help="such as tow,gx,gy,gz,ax,ay,az (default: by header)"
    )
    parser.add_argument(
        "--gyro-unit", metavar="UNIT", help="rad/s, deg/s or deg/h (default: by header, else rad/s)"
    )
    parser.add_argument(
        "--accel-unit", metavar="UNIT", help="m/s^2, g or mg (default: by header, else m/s^2)"
    )
    parser.add_argument(
        "--quantity",
        choices=("mean_rate", "increments", "instant_rate"),
        help="what a sample is (default: mean_rate)",
    )
    parser.add_argument(
        "--latitude",
        type=float,
        metavar="DEG",
        help="of the place, for its gravity (default: 9.80665 +- 0.02 m/s^2)",
    )
    parser.add_argument(
        "--height",
        type=float,
        default=0.0,
        metavar="M",
        help="of the place above the ellipsoid (default: 0)",
    )
    parser.add_argument(
        "--out",
        type=Path,
        metavar="FILE",
        help="what to write (default: calibration.toml beside IMU_FILE)",
    )
    parser.add_argument(
        "--force", action="store_true", help="overwrite the calibration of another recording"
    )


def run(options: argparse.Namespace, progress: Progress) -> int:
    """Do what the parsed command line asks for; return the exit code."""
    if options.latitude is not None and not abs(options.latitude) <= 90.0:
        raise UsageError(
            f"calibrate imu: latitude {options.latitude} deg is beyond 90; give degrees, north"
            " positive"
        )
    from ...flight.processing.checks import sentence
    from ...io.formats import read_imu
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
    imu = read_imu(options.imu, **spec)
    progress("calibrating")
    result = calibrate_multi_position(
        imu, None if options.latitude is None else math.radians(options.latitude), options.height
    )
    notes = [f"note: {sentence(note)}" for note in imu.notes]
    summary = "\n".join([*notes, result.summary()])
    figures = result.as_dict() | {"file": out, "notes": notes}
    flight = () if options.flight is None else (options.flight,)
    with together():
        write_calibration(result.calibration, out, (*summary.splitlines(), _origin(options.imu)))
        write_json(document, figures | made_from((options.imu, *flight), document, [out]))
    return show(options, progress, lambda: f"{summary}\n{out}\n{document}", lambda: figures)


def _origin(imu: Path) -> str:
    """Return the line of a calibration that says what it was made from."""
    return f"of {imu.name}, sha256 {sha256(imu)}"


def _refuse_others(out: Path, imu: Path) -> None:
    """Refuse to overwrite the calibration of another recording."""
    if out.is_file() and imu.is_file():
        text = out.read_text(encoding="utf-8", errors="replace")
        if sha256(imu) not in text:
            raise UsageError(
                f"calibrate imu: {out} is there, and was not made from {imu}; give another --out,"
                " or --force"
            )


def _imu_spec(options: argparse.Namespace) -> dict[str, Any]:
    """How to read the IMU file: of a flight file, of the options beside it."""
    given = {"gyro": options.gyro_unit, "accel": options.accel_unit}
    units = {sensor: unit for sensor, unit in given.items() if unit}
    columns = (
        tuple(name.strip() for name in options.columns.split(",")) if options.columns else None
    )
    spec = {"columns": columns, "units": units or None, "quantity": options.quantity}
    if options.flight is None:
        return spec
    if any(spec.values()):
        raise UsageError(
            "calibrate imu: --flight says columns, units and quantity; leave the other options out"
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
    "bias, scale factors and non-orthogonality of an IMU from a recording at rest in nine positions"
    " and more",
    "  insgnss calibrate imu turned_by_hand.csv --latitude 46.57 --height 420 --out navchip1.toml",
    add_arguments,
    run,
)
