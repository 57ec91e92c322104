"""The verb `camera`: calibrations of any program, read, compared and converted."""

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from ..io.options.kinds import Checked
from ..io.options.schema import argument
from .console import Progress
from .verb import Result, Verb

READ = "toml metashape opencv kalibr colmap pix4d opensfm bentley inpho dbat"
"""Formats of `io.formats.returned.cameras`, named here so that help needs no numpy."""
WRITTEN = "toml metashape colmap opencv opensfm"
EXAMPLE = """  insgnss camera calibration.xml camera.toml
  insgnss camera cameras.txt --name 2 --as toml --out camera.toml"""


@dataclass(frozen=True)
class CameraRequest(Checked):
    """Options of the verb."""

    file: Path = argument(..., f"calibration of {', '.join(READ.split())}", cli="FILE")
    second: Path | None = argument(
        None,
        "a second camera file, to compare with the first in pixels over the image",
        cli="FILE2",
    )
    name: str | None = argument(None, "name of the camera to read, if the file has several")
    form: str | None = argument(
        None, f"write FILE as {', '.join(WRITTEN.split())}", cli="--as", metavar="FORMAT"
    )
    out: Path | None = argument(None, "the file to write")
    distortion: Literal["forward", "backward", "forward-p2x", "backward-p2x"] | None = argument(
        None,
        "direction of the distortion of an Inpho project, which its file does not state: forward"
        " (from ideal to image points) or backward; with -p2x, P2 instead of P1 belongs to x",
    )
    force: bool = argument(False, "overwrite an existing file that differs")


def run(options: argparse.Namespace, progress: Progress) -> Result:
    """Do what the parsed command line asks for."""
    from ..photogrammetry.comparison.cameras import report_cameras

    progress("reading cameras")
    named = options.name, options.form, options.out, options.force, options.distortion
    return report_cameras(options.file, options.second, *named)


VERB = Verb("camera", EXAMPLE, (CameraRequest,), run)
