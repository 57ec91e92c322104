"""The verb `simulate`: a simulated data set in the published tree."""

import argparse
from pathlib import Path

from ..base.errors import UsageError
from .console import Progress
from .verb import Verb, positive, show

SURVEYS = ("ign8", "ign6x1")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    parser.add_argument("directory", type=Path, metavar="DIR", help="the data set's root")
    parser.add_argument(
        "--flight",
        choices=("ign8", "ign6x1", "car", "walk"),
        help="block (ign8), corridor (ign6x1), a drive in a town (car) or a walk (default: ign8)",
    )
    parser.add_argument(
        "--minutes",
        type=positive,
        metavar="M",
        help="length of the record (default: that of the flight's plan, of car and walk 5)",
    )
    parser.add_argument(
        "--imu-rate",
        type=positive,
        default=500.0,
        metavar="HZ",
        help="IMU samples a second (default: 500)",
    )
    shakes = (
        "factor of the IMU's white noise in motion against the noise model of the flight file"
        " (default: 1)"
    )
    parser.add_argument("--vibration", type=positive, default=1.0, metavar="X", help=shakes)
    raw = (
        "write RINEX 2.11 of rover, base and satellites as well, for `insgnss process` to start"
        " from"
    )
    parser.add_argument("--raw-gnss", action="store_true", help=raw)
    block = (
        "write image observations, ground control and check points and a camera of ign8 or ign6x1"
        " as well, with their truth"
    )
    parser.add_argument(
        "--block",
        nargs="?",
        const="",
        type=_survey,
        metavar="FLIGHT",
        help=f"{block} (of --flight; or name the flight here)",
    )
    parser.add_argument(
        "--gross-errors",
        type=float,
        metavar="SHARE",
        help="of --block: share of image observations that are off by 10 to 100 px (default: 0)",
    )
    parser.add_argument(
        "--seed", type=int, default=0, metavar="N", help="of the random numbers (default: 0)"
    )


def _survey(text: str) -> str:
    """Return the name of a survey flight."""
    if text and text not in SURVEYS:  # argparse asks for the constant too
        raise argparse.ArgumentTypeError(
            f"{text!r} is no survey flight, of which there are {' and '.join(SURVEYS)}; a DIR"
            " stands before it"
        )
    return text


def run(options: argparse.Namespace, progress: Progress) -> int:
    """Do what the parsed command line asks for; return the exit code."""
    from ..simulation.dataset import write_dataset

    if options.block and options.flight not in (None, options.block):
        raise UsageError(
            f"--flight {options.flight} and --block {options.block} are two flights; keep one"
        )
    flight = options.flight or options.block or "ign8"
    progress(f"simulating {flight}")
    arguments = {
        "flight": flight,
        "minutes": options.minutes,
        "vibration": options.vibration,
        "seed": options.seed,
    }
    if options.raw_gnss:
        from ..simulation.raw_gnss.scenario import RawGnssOptions

        arguments["raw_gnss"] = RawGnssOptions()
    if options.block is not None:
        from ..simulation.image_block import BlockOptions

        arguments["block"] = BlockOptions.of(flight, options.gross_errors or 0.0)
    elif options.gross_errors is not None:
        raise UsageError("--gross-errors is of image observations; give --block too")
    write_dataset(options.directory, imu_rate=options.imu_rate, **arguments)
    flight_file = options.directory / "flight.toml"
    message = f"{flight_file}\nnext: insgnss process {flight_file}"
    if options.block is not None:
        message += f", then insgnss adjust {options.directory / 'block.toml'}"
    return show(options, progress, lambda: message, lambda: {"flight": flight_file})


VERB = Verb(
    "simulate",
    "write a simulated data set in the published tree, with the truth beside it",
    "  insgnss simulate block --flight ign8 --minutes 15 --seed 3\n  insgnss simulate from_rinex"
    " --minutes 15 --raw-gnss\n  insgnss simulate images --flight ign6x1 --block --gross-errors"
    " 0.01",
    add_arguments,
    run,
)
