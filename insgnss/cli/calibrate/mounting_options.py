"""Options that the calibrations of a lever arm have in common."""

import argparse
import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from ..console import Progress
from ..verb import show_judged

if TYPE_CHECKING:
    from ...photogrammetry.mounting_calibration.poses import PlaceOptions, PoseSigma
    from ...photogrammetry.mounting_calibration.products import CalibratedMounting


def add_common(parser: argparse.ArgumentParser) -> None:
    """Add options of poses, of places and of what the file is to say."""
    parser.add_argument(
        "--pose-sigma",
        type=pair,
        metavar="M,DEG",
        help="standard deviations of poses whose file has none (default: 0.01,0.01)",
    )
    add_places(parser)
    add_products(parser)


def add_places(parser: argparse.ArgumentParser) -> None:
    """Add the CRS of tables."""
    parser.add_argument(
        "--crs",
        metavar="CRS",
        help="of tables with x y z on the Earth, such as EPSG:2056+5728 (default: local axes)",
    )
    parser.add_argument(
        "--geoid", type=Path, metavar="FILE", help="grid of geoid heights, for --crs"
    )


def add_products(parser: argparse.ArgumentParser) -> None:
    """Add what the file is to say of itself, and where it goes."""
    parser.add_argument(
        "--photo",
        type=Path,
        metavar="IMAGE",
        help="an image of the camera, whose Exif names it in the file",
    )
    parser.add_argument(
        "--date", type=iso_date, metavar="YYYY-MM-DD", help="of the data, where no file says it"
    )
    parser.add_argument(
        "--compare",
        type=Path,
        metavar="FILE",
        help="another mounting.toml, whose lever arm is compared",
    )
    parser.add_argument(
        "--out",
        type=toml_path,
        default=Path("mounting.toml"),
        metavar="FILE",
        help="what to write, and a page beside it (default: mounting.toml)",
    )
    parser.add_argument(
        "--force", action="store_true", help="overwrite a file that was made from other inputs"
    )


def toml_path(text: str) -> Path:
    """Return the name of a file of a mounting in a directory that is there."""
    path = Path(text)
    if path.suffix.lower() != ".toml":
        raise argparse.ArgumentTypeError(f"{text!r}: give a name that ends in .toml")
    if not path.absolute().parent.is_dir():
        raise argparse.ArgumentTypeError(f"{text!r}: there is no directory {path.parent}")
    return path


def pair(text: str) -> tuple[float, float]:
    """Return two numbers above zero."""
    try:
        first, second = (float(word) for word in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not two numbers, M,DEG") from None
    if not (0.0 < first < 1e3 and 0.0 < second < 90.0):
        raise argparse.ArgumentTypeError(f"{text!r}: both must be greater than zero")
    return first, second


def iso_date(text: str) -> str:
    """Return a date such as 2018-07-06."""
    try:
        return datetime.date.fromisoformat(text).isoformat()
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no date such as 2018-07-06") from None


def pose_sigma(options: argparse.Namespace) -> "PoseSigma":
    """Return the standard deviations of poses."""
    from ...photogrammetry.mounting_calibration.poses import PoseSigma

    return PoseSigma() if options.pose_sigma is None else PoseSigma(*options.pose_sigma)


def places(options: argparse.Namespace) -> "PlaceOptions":
    """Return the CRS of tables."""
    from ...photogrammetry.mounting_calibration.poses import PlaceOptions

    return PlaceOptions(options.crs, options.geoid)


def finished(
    options: argparse.Namespace, progress: Progress, result: "CalibratedMounting", *files: Path
) -> int:
    """Write and print a result; return the exit code."""
    from ...photogrammetry.mounting_calibration.products import compared, written

    if options.compare is not None:
        result = compared(result, options.compare)
    progress("write")
    return show_judged(options, progress, written(result, options.out, options.force), *files)
