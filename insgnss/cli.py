"""The command line: verbs, exit codes and what a person sees of a run.

Standard output carries the result (with ``--json`` one JSON document), standard error warnings and errors, one line each, and
on a terminal the step that is running. Where standard error is no terminal the steps are plain lines among the results
instead, so that an error stays the one line it is. Exit codes: 0 done, 1 a defect of insgnss, 2 wrong use, 3 bad input,
4 the data do not support the answer, 130 interrupted. Nothing heavy is imported before a verb needs it.
"""

import argparse
import gc
import json
import math
import os
import sys
import traceback
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NoReturn

from . import __version__
from .caches import settle
from .console import Parser, Progress
from .errors import InputError, InsgnssError, UsageError
from .files import json_ready

INTERRUPTED = 130


def run() -> NoReturn:
    """The program `insgnss`: one command in a process of its own."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # the matrices are 30 x 30: more threads only spin
    gc.disable()  # a run makes few cycles and ends soon; looking for them takes a tenth of its time
    sys.exit(main())


def _run_verb(argv: Sequence[str], progress: Progress) -> int:
    try:
        options = build_parser().parse_args(argv)
    except SystemExit as request:  # --help and --version
        return int(request.code or 0)
    if line := settle():
        warnings.warn(line, stacklevel=2)
    code: int = options.run(options, progress)
    return code


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code; `argv` without the program's name, of the process by default."""
    argv = list(sys.argv[1:] if argv is None else argv)
    as_json, debug = "--json" in argv, "--debug" in argv
    progress = Progress(sys.stderr, None if as_json else sys.stdout, quiet="--quiet" in argv or "-q" in argv)
    with warnings.catch_warnings():
        warnings.showwarning = _warn_in_one_line(progress)
        try:
            code = _run_verb(argv, progress)
            sys.stdout.flush()
        except BrokenPipeError:  # the reader of our output has seen enough
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            code = 0
        except (Exception, KeyboardInterrupt) as error:
            code, line = _verdict(error)
            progress.clear()
            if debug:
                traceback.print_exc()
            _report_error(line, code, as_json)
    return code


def _verdict(error: BaseException) -> tuple[int, str]:
    """Exit code and one line for what ended the run."""
    if isinstance(error, InsgnssError):
        return error.exit_code, f"error: {error}"
    if isinstance(error, OSError):
        where = f"{error.filename}: " if error.filename else ""
        return InputError.exit_code, f"error: {where}{error.strerror or error}; check path, permission and free space"
    if isinstance(error, KeyboardInterrupt):
        return INTERRUPTED, "error: interrupted"
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if Path(__file__).parent in Path(frame.filename).parents] or frames
    place = f"{own[-1].filename}:{own[-1].lineno}"
    return (
        InsgnssError.exit_code,
        f"internal error: {type(error).__name__}: {error} (at {place}); this is a defect, --debug shows the traceback",
    )


def _report_error(line: str, code: int, as_json: bool) -> None:
    line = " ".join(line.split())
    print(f"insgnss: {line}", file=sys.stderr)
    if as_json:
        _print_json({"error": line.partition("error: ")[2], "exit_code": code})


def _warn_in_one_line(progress: Progress) -> Callable[..., None]:
    def show(message: Warning | str, category: type[Warning], *where: Any, **more: Any) -> None:
        progress.clear()
        print(f"insgnss: warning: {' '.join(str(message).split())}", file=sys.stderr)

    return show


def _print_json(document: Any) -> None:
    print(json.dumps(json_ready(document), indent=2, allow_nan=False))


def _positive(text: str) -> float:
    value = float(text)
    if not 0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"{text!r} is not greater than zero")
    return value


def build_parser() -> Parser:
    """Parser of all verbs."""
    parser = Parser(
        prog="insgnss",
        description="From a mapping drone's raw IMU and GNSS data to the exterior orientation of every image.",
        epilog="exit codes: 0 done, 2 wrong use, 3 bad input, 4 the data do not support the answer\nfirst steps: insgnss demo",
    )
    parser.add_argument("--version", action="version", version=f"insgnss {__version__}")
    verbs = parser.add_subparsers(metavar="VERB", required=True, dest="verb", parser_class=Parser)
    _add_demo(verbs)
    _add_simulate(verbs)
    _add_inspect(verbs)
    _add_process(verbs)
    _add_export(verbs)
    _add_calibrate(verbs)
    _add_tune(verbs)
    _add_compare(verbs)
    _add_ppk(verbs)
    _add_verify(verbs)
    return parser


def _add_verb(verbs: Any, name: str, run: Callable[[argparse.Namespace, Progress], int], what: str, example: str, **more: Any) -> Parser:
    parser: Parser = verbs.add_parser(name, help=what, description=f"{what[0].upper()}{what[1:]}.", epilog=f"example:\n{example}", **more)
    parser.add_argument("--json", action="store_true", help="a machine's view of the result on standard output")
    parser.add_argument("-q", "--quiet", action="store_true", help="no steps while it runs")
    parser.add_argument("--debug", action="store_true", help="the traceback of an error")
    parser.set_defaults(run=run)
    return parser


def _add_demo(verbs: Any) -> None:
    what = "simulate a short flight, process it, print the errors against truth, leave the report"
    parser = _add_verb(verbs, "demo", _demo, what, "  insgnss demo\n  insgnss demo my_demo --minutes 10 --seed 7")
    parser.add_argument("directory", nargs="?", type=Path, metavar="DIR", help="where the data set goes (default: insgnss_demo)")
    parser.add_argument("--minutes", type=_positive, default=8.0, metavar="M", help="length of the flight (default: 8)")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of the random numbers (default: 0)")


def _add_simulate(verbs: Any) -> None:
    what = "write a simulated data set in the published tree, with the truth beside it"
    example = "  insgnss simulate block --flight ign8 --minutes 15 --seed 3\n  insgnss simulate from_rinex --minutes 15 --raw-gnss"
    parser = _add_verb(verbs, "simulate", _simulate, what, example)
    parser.add_argument("directory", type=Path, metavar="DIR", help="the data set's root")
    parser.add_argument("--flight", choices=("ign8", "ign6x1"), default="ign8", help="block (ign8) or corridor (ign6x1) (default: ign8)")
    parser.add_argument("--minutes", type=_positive, metavar="M", help="length of the flight (default: that of the flight's plan)")
    parser.add_argument("--imu-rate", type=_positive, default=500.0, metavar="HZ", help="IMU samples a second (default: 500)")
    shakes = "factor of the IMU's white noise in motion against the noise model of the flight file (default: 1)"
    parser.add_argument("--vibration", type=_positive, default=1.0, metavar="X", help=shakes)
    raw = "write RINEX 2.11 of rover, base and satellites as well, for `insgnss process` to start from"
    parser.add_argument("--raw-gnss", action="store_true", help=raw)
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of the random numbers (default: 0)")


def _add_inspect(verbs: Any) -> None:
    what = "say what a recording is: files, units, axes, clocks, noise, plausibility; and draft its flight file"
    example = "  insgnss inspect ign8/flight.toml\n  insgnss inspect my_recording --write\n  insgnss inspect imu.csv gps.pos --write a.toml"
    parser = _add_verb(verbs, "inspect", _inspect, what, example)
    parser.add_argument("source", type=Path, nargs="+", metavar="SOURCE", help="a flight file, a directory, or the files of a recording")
    where = "write a flight file of what is found, and the noise model and a picture beside it (default: flight.toml)"
    parser.add_argument("--write", type=Path, nargs="?", const=Path("flight.toml"), metavar="FLIGHT", help=where)
    parser.add_argument("--force", action="store_true", help="let --write take the place of files that are there")


def _add_process(verbs: Any) -> None:
    what = "raw data in, exterior orientation, trajectory and report out"
    parser = _add_verb(verbs, "process", _process, what, "  insgnss process ign8/flight.toml --out results")
    parser.add_argument("flight", type=Path, metavar="FLIGHT", help="the flight file, or the directory that holds flight.toml")
    parser.add_argument("--out", type=Path, metavar="DIR", help="where the products go (default: output.directory of the flight file)")


def _add_export(verbs: Any) -> None:
    from .exporting.verb import EXAMPLE, add_arguments

    what = "write the master exterior orientation in the format of a bundle adjustment"
    add_arguments(_add_verb(verbs, "export", _export, what, EXAMPLE, more_help=_list_formats))


def _add_calibrate(verbs: Any) -> None:
    what = "bias, scale factors and non-orthogonality of an IMU from a recording at rest in nine positions and more"
    example = "  insgnss calibrate turned_by_hand.csv --latitude 46.57 --height 420 --out navchip1.toml"
    parser = _add_verb(verbs, "calibrate", _calibrate, what, example)
    parser.add_argument("imu", type=Path, metavar="IMU_FILE", help="samples of an IMU that rests 5 s and more in each position")
    parser.add_argument("--flight", type=Path, metavar="FLIGHT", help="a flight file whose [imu] says columns, units and quantity")
    parser.add_argument("--columns", metavar="NAMES", help="such as tow,gx,gy,gz,ax,ay,az (default: by header)")
    parser.add_argument("--gyro-unit", metavar="UNIT", help="rad/s, deg/s or deg/h (default: by header, else rad/s)")
    parser.add_argument("--accel-unit", metavar="UNIT", help="m/s^2, g or mg (default: by header, else m/s^2)")
    parser.add_argument("--quantity", choices=("mean_rate", "increments", "instant_rate"), help="what a sample is (default: mean_rate)")
    parser.add_argument("--latitude", type=float, metavar="DEG", help="of the place, for its gravity (default: 9.80665 +- 0.02 m/s^2)")
    parser.add_argument("--height", type=float, default=0.0, metavar="M", help="of the place above the ellipsoid (default: 0)")
    parser.add_argument("--out", type=Path, metavar="FILE", help="what to write (default: calibration.toml beside IMU_FILE)")


def _add_tune(verbs: Any) -> None:
    from .tuning.options import EXAMPLE, add_arguments

    what = "a noise model, with its uncertainty, from static recordings of an IMU or from the innovations of a flight"
    add_arguments(_add_verb(verbs, "tune", _tune, what, EXAMPLE), _positive)


def _add_compare(verbs: Any) -> None:
    from .comparison.verb import EXAMPLE, add_arguments

    what = "differences of two exterior orientations or trajectories, and which mistaken convention explains them"
    add_arguments(_add_verb(verbs, "compare", _compare, what, EXAMPLE))


def _add_ppk(verbs: Any) -> None:
    from .gnss.verb import EXAMPLE, add_arguments

    what = "antenna positions with honest covariances from RINEX of rover and base, by RTKLIB"
    add_arguments(_add_verb(verbs, "ppk", _ppk, what, EXAMPLE))


def _add_verify(verbs: Any) -> None:
    from .reference.verb import EXAMPLE, add_arguments

    what = "a part of a flight by the core and by a textbook implementation, and their largest difference in sigmas"
    add_arguments(_add_verb(verbs, "verify", _verify, what, EXAMPLE), _positive)


def _list_formats() -> str:
    from .formats import EXPORTS

    width = max(map(len, EXPORTS))
    lines = []
    for name, form in EXPORTS.items():
        takes = f" (--set {', '.join(form.options)})" if form.options else ""
        lines.append(f"  {name:{width}}  {'experimental: ' if form.experimental else ''}{form.what}{takes}\n")
    return "formats:\n" + "".join(lines)


def _demo(options: argparse.Namespace, progress: Progress) -> int:
    from . import pipeline

    result = pipeline.demo(options.directory, options.minutes, options.seed, progress)
    return _show(options, progress, result.summary, result.as_dict)


def _simulate(options: argparse.Namespace, progress: Progress) -> int:
    from .simulate.dataset import write_dataset

    progress(f"simulating {options.flight}")
    flown = {"flight": options.flight, "minutes": options.minutes, "vibration": options.vibration, "seed": options.seed}
    if options.raw_gnss:
        from .simulate.raw_gnss import RawGnssOptions

        flown["raw_gnss"] = RawGnssOptions()
    write_dataset(options.directory, imu_rate=options.imu_rate, **flown)
    flight_file = options.directory / "flight.toml"
    what = f"{flight_file}\nnext: insgnss process {flight_file}"
    return _show(options, progress, lambda: what, lambda: {"flight": flight_file})


def _inspect(options: argparse.Namespace, progress: Progress) -> int:
    from .inspection.described import flight_file, inspect_flight
    from .inspection.run import inspect_files

    if options.force and options.write is None:
        raise UsageError("inspect: --force belongs to --write")
    described = flight_file(options.source, options.write is not None)
    if described is not None:
        return _judged(options, progress, inspect_flight(described, progress), *options.source)
    result = inspect_files(options.source, progress)
    if options.write is not None and not result.missing:
        progress("writing")
        result = result.write(options.write, options.force)
    return _judged(options, progress, result, *options.source)


def _judged(options: argparse.Namespace, progress: Progress, result: Any, *files: Path) -> int:
    """Print a result of `files`; 0, or the code of its refusal, if any, which one line on standard error says."""
    refusal = result.refusal
    if refusal is None:
        return _show(options, progress, result.summary, result.as_dict)
    error, code = f"{', '.join(map(str, files))}: {refusal}", refusal.exit_code
    _show(options, progress, result.summary, lambda: result.as_dict() | {"error": error, "exit_code": code})
    _report_error(f"error: {error}", code, as_json=False)
    return code


def _process(options: argparse.Namespace, progress: Progress) -> int:
    from .flight import load_flight

    flight = load_flight(options.flight)
    from . import pipeline

    result = pipeline.process(flight, options.out, progress)
    return _show(options, progress, result.summary, lambda: result.report)


def _export(options: argparse.Namespace, progress: Progress) -> int:
    if options.proof:
        from .proof.verb import proof_verb as verb
    else:
        from .exporting.verb import export_verb as verb
    result = verb(options, progress)
    return _show(options, progress, result.summary, result.as_dict)


def _calibrate(options: argparse.Namespace, progress: Progress) -> int:
    if options.latitude is not None and not abs(options.latitude) <= 90.0:
        raise UsageError(f"calibrate: latitude {options.latitude} deg is beyond 90; give degrees, north positive")
    from .calibrate.multi_position import calibrate_multi_position
    from .formats import read_imu
    from .prepare.calibration import write_calibration
    from .recording import sentence

    spec = _imu_spec(options)
    progress("reading")
    imu = read_imu(options.imu, **spec)
    progress("calibrating")
    result = calibrate_multi_position(imu, None if options.latitude is None else math.radians(options.latitude), options.height)
    out = options.out or options.imu.parent / "calibration.toml"
    notes = [f"note: {sentence(note)}" for note in imu.notes]
    summary = "\n".join([*notes, result.summary()])
    write_calibration(result.calibration, out, tuple(summary.splitlines()))
    return _show(options, progress, lambda: f"{summary}\n{out}", lambda: result.as_dict() | {"file": out, "notes": notes})


def _imu_spec(options: argparse.Namespace) -> dict[str, Any]:
    """How to read the IMU file: of a flight file, of the options beside it."""
    given = {"gyro": options.gyro_unit, "accel": options.accel_unit}
    units = {sensor: unit for sensor, unit in given.items() if unit}
    columns = tuple(name.strip() for name in options.columns.split(",")) if options.columns else None
    spec = {"columns": columns, "units": units or None, "quantity": options.quantity}
    if options.flight is None:
        return spec
    if any(spec.values()):
        raise UsageError("calibrate: --flight says columns, units and quantity; leave the other options out")
    from .flight import load_flight

    flight = load_flight(options.flight)
    imu = flight.imu
    return {
        "columns": imu.columns,
        "units": imu.units or None,
        "quantity": imu.quantity,
        "variable": imu.variable,
        "gps_week": flight.gps_week,
    }


def _tune(options: argparse.Namespace, progress: Progress) -> int:
    from .tuning.verb import tune

    result = tune(options, progress)
    return _show(options, progress, result.summary, result.as_dict)


def _compare(options: argparse.Namespace, progress: Progress) -> int:
    from .comparison.verb import compare

    result = compare(options, progress)
    return _show(options, progress, result.summary, result.as_dict)


def _ppk(options: argparse.Namespace, progress: Progress) -> int:
    from .gnss.verb import ppk
    from .report.gnss import draw_quality

    result = ppk(options, progress, draw_quality)
    return _show(options, progress, result.summary, result.as_dict)


def _verify(options: argparse.Namespace, progress: Progress) -> int:
    from .reference.verb import verify_verb

    return _judged(options, progress, verify_verb(options, progress), options.flight)


def _show(options: argparse.Namespace, progress: Progress, summary: Callable[[], str], document: Callable[[], dict[str, Any]]) -> int:
    """Print the result as text or JSON; 0."""
    progress.clear()
    if options.json:
        _print_json(document())
    else:
        print(summary())
    return 0
