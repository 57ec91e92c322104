"""`insgnss calibrate tripod | similarity | materialise | mounting`: constants of the mounting.

The first three take two files and find the lever arm from camera to antenna; `mounting` takes a
flight and poses of its images, and finds lever arms, bore-sight and camera delay.
"""

import argparse
from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING

from ...base.errors import OptionError
from ...io.options.kinds import Checked
from ...io.options.schema import argument
from ...photogrammetry.mounting_calibration.options import (
    Assumptions,
    MaterialiseOptions,
    SimilarityOptions,
    TripodOptions,
)
from ..console import Progress
from ..verb import Judged, Verb

if TYPE_CHECKING:
    from ...photogrammetry.mounting_calibration.products import CalibratedMounting


@dataclass(frozen=True)
class MountingProducts(Checked):
    """Where the file goes, and what it is compared with."""

    compare: Path | None = argument(
        None, "another mounting.toml, to compare its lever arm with the result"
    )
    out: Path = argument(
        Path("mounting.toml"), "the file to write; a report page (.html) is written beside it"
    )
    force: bool = argument(False, "overwrite a file that was made from other inputs")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.out.suffix.lower() != ".toml":
            raise OptionError("out", "give a name that ends in .toml", self.out)
        if not self.out.absolute().parent.is_dir():
            raise OptionError("out", f"there is no directory {self.out.parent}", self.out)


@dataclass(frozen=True)
class TripodFiles:
    """Files of `tripod`."""

    poses: Path = argument(
        ...,
        "camera poses, one for each setup (a table with columns image, x, y, z, omega, phi, kappa,"
        " ..., eo.json, Metashape, COLMAP, ...)",
        cli="POSES",
    )
    pins: Path = argument(
        ...,
        "positions of the tip of the pin that replaces the antenna: a table with the same setup"
        " names and x, y, z",
        cli="PINS",
    )


@dataclass(frozen=True)
class SimilarityFiles:
    """Files of `similarity`."""

    cameras: Path = argument(
        ...,
        "adjusted poses in any frame: Metashape, COLMAP, OpenSfM, eo.json, a table, ...",
        cli="CAMERAS",
    )
    antenna: Path = argument(
        ...,
        "antenna positions at the exposures: a table with columns image, x, y, z or image, lat,"
        " lon, h, or a Metashape file that has them as references",
        cli="ANTENNA",
    )


@dataclass(frozen=True)
class MaterialiseFiles:
    """Files of `materialise`."""

    camera: Path = argument(
        ...,
        "targets on the camera in a scaled frame: a table with columns name, x, y, z, or a"
        " photogrammetric block in which they are measured",
        cli="CAMERA",
    )
    mounted: Path = argument(
        ...,
        "targets on camera and receiver, measured in one block of images of the aircraft before"
        " the flight; table or block as for the camera, any frame and unit",
        cli="MOUNTED",
    )


@dataclass(frozen=True)
class FlightFiles:
    """Files of `mounting`."""

    flight: Path = argument(
        ..., "the flight file, or the directory that holds flight.toml", cli="FLIGHT"
    )
    poses: Path = argument(
        ...,
        "adjusted poses of its images in any frame: Metashape, COLMAP, OpenSfM, MicMac, eo.json,"
        " poses.csv, ...",
        cli="POSES",
    )


def _written_result(
    options: argparse.Namespace, progress: Progress, result: "CalibratedMounting", *files: Path
) -> Judged:
    """Write the result of a calibration of `files`."""
    from ...photogrammetry.mounting_calibration.products import compare_arms, write_mounting

    if options.compare is not None:
        result = compare_arms(result, options.compare)
    progress("write")
    result = write_mounting(result, options.out, options.force)
    return Judged(result, result.refusal, files)


def _of_two_files(name: str, example: str, inputs: type, chosen: type) -> Verb:
    """Return the verb of a calibration of two files, which the module of its name holds."""

    def run(options: argparse.Namespace, progress: Progress) -> Judged:
        from ...photogrammetry.mounting_calibration.materialise_files import calibrate_materialise
        from ...photogrammetry.mounting_calibration.similarity_files import calibrate_similarity
        from ...photogrammetry.mounting_calibration.tripod_files import calibrate_tripod

        calibrate: dict[str, Callable[..., CalibratedMounting]] = {
            "tripod": calibrate_tripod,
            "similarity": calibrate_similarity,
            "materialise": calibrate_materialise,
        }
        progress("calibrating")
        files = [getattr(options, field.name) for field in fields(inputs)]
        return _written_result(
            options, progress, calibrate[name](*files, options.records[chosen]), *files
        )

    return Verb(name, example, (inputs, chosen, MountingProducts), run)


def _run_mounting(options: argparse.Namespace, progress: Progress) -> Judged:
    """Do what the parsed command line asks for."""
    from ...flight.config.load import load_flight
    from ...photogrammetry.mounting_calibration.flight_products import flight_result
    from ...photogrammetry.mounting_calibration.in_flight import calibrate_mounting

    flight = load_flight(options.flight)
    result = calibrate_mounting(flight, options.poses, options.records[Assumptions], progress)
    calibration = flight_result(result, flight, options.photo, options.date)
    return _written_result(options, progress, calibration, flight.path, options.poses)


MOUNTING_VERBS = (
    _of_two_files(
        "tripod",
        "  insgnss calibrate tripod poses.csv pin.csv --photo DSC0001.jpg --out mounting.toml",
        TripodFiles,
        TripodOptions,
    ),
    _of_two_files(
        "similarity",
        "  insgnss calibrate similarity cameras.xml antenna.csv --ground gcp.csv"
        " --crs EPSG:2056+5728\n"
        "  insgnss calibrate similarity cameras.xml cameras.xml --antenna-sigma 1,2",
        SimilarityFiles,
        SimilarityOptions,
    ),
    _of_two_files(
        "materialise",
        "  insgnss calibrate materialise camera.csv before.csv --pose poses.csv --image s.jpg \\\n"
        "      --receiver r0.csv r90.csv r180.csv r270.csv --after landed.csv",
        MaterialiseFiles,
        MaterialiseOptions,
    ),
    Verb(
        "mounting",
        "  insgnss calibrate mounting ign8/flight.toml cameras.xml\n"
        "  insgnss calibrate mounting ign8 ign8/02_Processed/Adjustment/poses.csv --frame shift"
        " --shift-sigma 0.01",
        (FlightFiles, Assumptions, MountingProducts),
        _run_mounting,
    ),
)
