"""The verb `simulate`: a simulated data set in the published tree."""

import argparse
from dataclasses import dataclass
from pathlib import Path

from ..base.errors import OptionError, UsageError
from ..io.options.kinds import Checked
from ..io.options.schema import argument
from .console import Progress
from .verb import Message, Verb

SURVEYS = ("ign8", "ign6x1")
PUBLISHED_BLOCKS = ("block2015", "corridor2014", "mapkite")
"""Of benchmarks/published_blocks, which imports numpy."""
IMU_RATE_HZ = 500.0  # rate of the simulated IMU (Hz): that of the published flights
VIBRATION = 1.0  # factor on a usual drone's vibration: one is usual


@dataclass(frozen=True)
class SimulateRequest(Checked):
    """Options of the verb; None where nobody gave them, since images alone have no sensors."""

    directory: Path = argument(..., "the data set's root", cli="DIR")
    flight: str | None = argument(
        None,
        "flight to simulate: block (ign8), corridor (ign6x1), a drive in a town (car) or a walk"
        " (default: ign8); or a published image block whose poses get random errors: block2015,"
        " corridor2014 (Rehak and Skaloud 2016), mapkite (Molina et al. 2017)",
        kind="choice",
        choices=(*SURVEYS, "car", "walk", *PUBLISHED_BLOCKS),
    )
    minutes: float | None = argument(
        None,
        "length of the record",
        positive=True,
        usual="planned duration; default for car and walk: 5",
        metavar="M",
    )
    imu_rate: float | None = argument(
        None, "IMU samples a second", positive=True, usual="500", metavar="HZ"
    )
    vibration: float | None = argument(
        None,
        "factor by which the IMU's white noise in motion exceeds the noise model of the flight"
        " file",
        positive=True,
        usual="1",
    )
    raw_gnss: bool = argument(
        False,
        "also write RINEX 2.11 of rover, base and satellites, from which `insgnss process` can"
        " start",
    )
    block: str | None = argument(
        None,
        "also write image observations, ground control and check points and a camera for ign8 or"
        " ign6x1, with their truth (default: for --flight)",
        alone="",
        metavar="FLIGHT",
    )
    gross_errors: float | None = argument(
        None,
        "share of image observations with gross errors of 10 to 100 px, for --block",
        needs=("block",),
        usual="0",
        metavar="SHARE",
    )
    unknown_boresight: float | None = argument(
        None,
        "bore-sight that the given poses do not include, for block2015, corridor2014 and mapkite",
        positive=True,
        metavar="DEG",
    )
    seed: int = argument(0, "of the random numbers")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.block and self.block not in SURVEYS:
            names = " and ".join(SURVEYS)
            problem = f"is not a survey flight ({names}); write the directory DIR before --block"
            raise OptionError("block", problem, self.block)


def run(options: argparse.Namespace, progress: Progress) -> Message:
    """Do what the parsed command line asks for."""
    if options.flight in PUBLISHED_BLOCKS:
        return _write_published_block(options, progress)
    if options.unknown_boresight is not None:
        blocks = ", ".join(PUBLISHED_BLOCKS)
        raise UsageError(f"--unknown-boresight is only for --flight {blocks}; leave it out")
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
        "vibration": options.vibration or VIBRATION,
        "seed": options.seed,
    }
    if options.raw_gnss:
        from ..simulation.raw_gnss.options import RawGnssOptions

        arguments["raw_gnss"] = RawGnssOptions()
    if options.block is not None:
        from ..simulation.image_block import BlockOptions

        arguments["block"] = BlockOptions.of(flight, options.gross_errors or 0.0)
    imu_rate = options.imu_rate or IMU_RATE_HZ
    write_dataset(options.directory, imu_rate=imu_rate, **arguments)
    flight_file = options.directory / "flight.toml"
    message = f"{flight_file}\nnext: insgnss process {flight_file}"
    if options.block is not None:
        message += f", then insgnss adjust {options.directory / 'block.toml'}"
    return Message(message, {"flight": flight_file})


def _write_published_block(options: argparse.Namespace, progress: Progress) -> Message:
    """Write an image block of the literature."""
    for name in ("minutes", "imu_rate", "vibration", "raw_gnss", "block", "gross_errors"):
        if getattr(options, name) not in (None, False):
            option = f"--{name.replace('_', '-')}"
            raise UsageError(
                f"{option} has no effect with --flight {options.flight}, which has the dimensions"
                f" of its paper and no simulated sensors; leave {option} out"
            )
    from ..simulation.plug import import_plugged

    simulate_survey = import_plugged("published_blocks.survey").simulate_survey
    write_survey = import_plugged("published_blocks.files").write_survey

    progress(f"simulating {options.flight}")
    boresight_deg = options.unknown_boresight or 0.0
    survey = simulate_survey(options.flight, options.seed, boresight_deg=boresight_deg)
    write_survey(options.directory, survey)
    block = options.directory / "block.toml"
    message = f"{block}\nnext: insgnss adjust {block}"
    return Message(message, {"block": block})


VERB = Verb(
    "simulate",
    "  insgnss simulate block --flight ign8 --minutes 15 --seed 3\n  insgnss simulate from_rinex"
    " --minutes 15 --raw-gnss\n  insgnss simulate images --flight ign6x1 --block --gross-errors"
    " 0.01\n  insgnss simulate corridor --flight corridor2014 --seed 1",
    (SimulateRequest,),
    run,
)
