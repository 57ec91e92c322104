"""The verb `adjust`: integrated sensor orientation of an image block."""

import argparse
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..base.errors import InputError, UsageError
from ..base.inputs import is_file
from ..base.wording import spoken_as
from ..flight.config.block_file import (
    ADJUSTED_DIRECTORY,
    BLOCK_TABLES,
    BlockFile,
    BlockOutput,
    load_block,
)
from ..flight.config.command_line import add_options, given_of, names_of
from ..io.options.schema import argument
from .console import Progress
from .verb import Judged, Result, Verb

if TYPE_CHECKING:
    pass

EXAMPLE = """\
  insgnss adjust block.toml
  insgnss adjust 02_Processed/GPS-INS/eo.json --images image_points.csv \\
      --camera camera.toml --ground ground_points.csv
  insgnss adjust eo.json --images project.psx --ground gcp.csv --crs EPSG:2056+5728 --check G4 G7
  insgnss adjust block.toml --trajectory flight.toml
  insgnss adjust DJI_202411_Timestamp.MRK --images project.xml --ground gcp.csv --crs EPSG:2056
  insgnss adjust simulated/02_Processed/GPS-INS/eo.json --plan --camera camera.toml \\
      --ground-height 510"""


@dataclass(frozen=True)
class AdjustRequest:
    """What is adjusted, and where the products go."""

    block: Path = argument(
        ...,
        "the block file (the options below replace its keys) or its directory; with --images: the"
        " eo.json of a processed flight, or positions of the images without an IMU: .MRK,"
        " camera_positions.csv, _events.pos, references of Metashape or Pix4D; or a project of a"
        " photogrammetry program that contains image observations and ground points",
        cli="BLOCK",
    )
    plan: bool = argument(
        False, "predict the precision of the planned block, without image observations"
    )
    out: Path | None = argument(
        None,
        "where the products go",
        usual=f"{ADJUSTED_DIRECTORY} beside BLOCK, or the directory named in BLOCK",
        metavar="DIR",
    )
    trajectory: Path | None = argument(
        None,
        "flight file from which BLOCK's orientation came; the flight is processed again together"
        " with the images, which correct trajectory, biases, antenna lever arm and clocks;"
        " products go into the directory trajectory of --out",
        metavar="FLIGHT",
    )
    force: bool = argument(False, "overwrite results of other image observations")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb: those that the tables of the block file declare."""
    add_options(parser, (AdjustRequest,))
    for table, kinds in BLOCK_TABLES.items():
        add_options(parser, kinds, (), table)


def block_of(options: argparse.Namespace) -> BlockFile:
    """Return the block that the command line asks for.

    Raises
    ------
    UsageError
        Options that do not go together.
    """
    file_of = {name: given_of(options, kind, name) for name, (kind,) in BLOCK_TABLES.items()}
    if not is_file(options.block) or options.block.suffix.lower() == ".toml":
        file = load_block(options.block)
    else:
        if "file" in file_of["images"] or options.plan:
            file_of["aerial_control"]["file"] = options.block
        elif _is_project(options.block):
            file_of["images"]["file"] = options.block
        else:
            raise UsageError(
                "adjust: image observations are missing; name their table, or the project of a"
                " photogrammetry program, by --images"
            )
        output = BlockOutput(directory=options.block.parent / ADJUSTED_DIRECTORY)
        name = options.block.absolute().parent.name
        file = BlockFile(path=options.block, name=name, output=output)
    with spoken_as(names_of(BLOCK_TABLES)):
        changed = {
            name: replace(getattr(file, name), **values)
            for name, values in file_of.items()
            if name and values
        }
    _refuse_missing(changed, options.block)
    return replace(file, **changed)


def _is_project(path: Path) -> bool:
    """Tell whether a file is a project of a photogrammetry program, with its own image points."""
    from ..io.formats.blocks.reading import recognise_format

    if path.suffix.lower() == ".json":  # an orientation
        return False
    try:
        return recognise_format(path) in ("dbat", "metashape", "colmap", "bingo")
    except InputError:
        return False


def _refuse_missing(tables: Mapping[str, Any], block: Path) -> None:
    """Refuse files that are not there."""
    files = [
        (f"--{name}", tables[name].file)
        for name in ("images", "camera", "ground")
        if name in tables
    ]
    bars = tables["ground"].distances if "ground" in tables else None
    for name, path in (*files, ("--distances", bars), ("BLOCK", block)):
        if path is not None and not path.exists():
            raise UsageError(f"adjust: {name} {path} does not exist; check the path")


def run(options: argparse.Namespace, progress: Progress) -> Result | Judged:
    """Do what the parsed command line asks for."""
    file = block_of(options)
    if options.plan:
        from ..photogrammetry.block_adjustment.plan import plan_block
        from ..photogrammetry.block_adjustment.run import directory_of

        out = directory_of(file, options.out)
        return plan_block(file, progress, out)
    from ..photogrammetry.block_adjustment.run import adjust

    flight = None
    if options.trajectory is not None:
        from ..flight.config.load import load_flight

        flight = load_flight(options.trajectory)
    result = adjust(file, options.out, progress, force=options.force, flight=flight)
    return Judged(result, result.refusal, (file.path,))


VERB = Verb("adjust", EXAMPLE, add_arguments, run)
