"""Where the calibrations of a mounting write their results."""

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ...base.errors import OptionError
from ...io.options.kinds import Checked
from ...io.options.schema import argument
from ..console import Progress
from ..verb import Judged

if TYPE_CHECKING:
    from ...photogrammetry.mounting_calibration.products import CalibratedMounting


@dataclass(frozen=True)
class Products(Checked):
    """Where the file goes, and what it is compared with."""

    compare: Path | None = argument(None, "another mounting.toml, whose lever arm is compared")
    out: Path = argument(Path("mounting.toml"), "what to write, and a page beside it")
    force: bool = argument(False, "overwrite a file that was made from other inputs")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.out.suffix.lower() != ".toml":
            raise OptionError("out", "give a name that ends in .toml", self.out)
        if not self.out.absolute().parent.is_dir():
            raise OptionError("out", f"there is no directory {self.out.parent}", self.out)


def finished(
    options: argparse.Namespace, progress: Progress, result: "CalibratedMounting", *files: Path
) -> Judged:
    """Write the result of a calibration of `files`."""
    from ...photogrammetry.mounting_calibration.products import compared, written

    if options.compare is not None:
        result = compared(result, options.compare)
    progress("write")
    result = written(result, options.out, options.force)
    return Judged(result, result.refusal, files)
