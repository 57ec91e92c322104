"""Grids of datum shifts and geoid heights: where a named one is, how to get one that is missing.

PROJ brings no such grids along. `pyproj sync --file NAME` gets one by its file name into the user's
directory of PROJ; the program `projsync` of PROJ does not come with Python's package.
"""

import os
import re
import sqlite3
import warnings
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.errors import UsageError
from ..base.wording import DOCTOR

Array = NDArray[np.float64]

AROUND_DEG = 0.1  # of the area of the points, in which transformations are looked for
SHORTEST_NAME = 4  # letters and digits of a geoid's name: fewer stand in names of other grids
MOST_NAMED = 3  # grids that an error proposes: more do not fit into a line
# how PROJ names its grids: country, agency, name
OF_PROJ = re.compile(r"[a-z]{2,3}_[a-z0-9]+_\S+\.tif")


HEIGHTS = "its heights"  # what needs a grid, for the message


def sync_commands(grids: Sequence[str]) -> str:
    """Return the commands that get PROJ's grids.

    Parameters
    ----------
    grids : sequence of str
        Their file names.

    Returns
    -------
    str
        One command for each, with commas between them.
    """
    return ", ".join(f"`pyproj sync --file {grid}`" for grid in grids)


def geoid_file(geoid: Path) -> Path:
    """Return the whole path of a grid of geoid heights.

    Parameters
    ----------
    geoid : Path
        The file, or the bare name of one in PROJ's directories, such as us_noaa_g2018u0.tif.

    Returns
    -------
    Path
        Whole, since PROJ would look for a bare name among its own grids only.

    Raises
    ------
    UsageError
        Where the file does not exist, with how to get a grid of PROJ.
    """
    from pyproj.datadir import get_data_dir, get_user_data_dir

    file = Path(geoid)
    if file.is_file():
        return file.resolve()
    if file.name == str(file):
        for directory in (get_user_data_dir(), *re.split("[;:]", get_data_dir())):
            if (Path(directory) / file).is_file():
                return (Path(directory) / file).resolve()
    if grids := [file.name] if OF_PROJ.fullmatch(file.name) else grids_called(file.name):
        raise UsageError(
            f"geoid {geoid}: does not exist here nor among PROJ's grids; get it by"
            f" {sync_commands(grids)}, and give its name"
        )
    raise UsageError(
        f"geoid {geoid}: does not exist, and PROJ has none of that name; give a grid of geoid"
        " heights such as us_nga_egm96_15.tif"
    )


def grids_called(name: str) -> list[str]:
    """Return PROJ's grids of geoid heights that people or agencies call so.

    Parameters
    ----------
    name : str
        Such as EGM96, egm08_25.gtx, GEOID18, RAF20; its ending is left out.

    Returns
    -------
    list of str
        File names, at most three, the shortest first; none of a name of fewer than four letters
        and digits.
    """
    from pyproj.datadir import get_data_dir

    plain = re.sub(r"[^a-z0-9]", "", Path(name).stem.lower())
    # NOAA's GEOID18 is g2018u0 among PROJ's grids
    plain = re.sub(r"^geoid(\d\d)", r"g20\1", plain).replace("egm2008", "egm08")
    if len(plain) < SHORTEST_NAME:
        return []
    database = Path(get_data_dir().split(os.pathsep)[0]).absolute() / "proj.db"
    with closing(sqlite3.connect(f"{database.as_uri()}?mode=ro", uri=True)) as proj:
        rows = proj.execute(
            "SELECT DISTINCT proj_grid_name, original_grid_name, old_proj_grid_name"
            " FROM grid_alternatives WHERE proj_method IN ('geoid_like', 'vgridshift') ORDER BY 1"
        ).fetchall()
    grids = [
        row[0]
        for row in rows
        if any(plain in re.sub(r"[^a-z0-9]", "", str(alias).lower()) for alias in row)
    ]
    return sorted(dict.fromkeys(grids), key=len)[:MOST_NAMED]


def operations(source: Any, target: Any, lat: Array, lon: Array) -> Any:
    """Return PROJ's transformations between two CRSs around points.

    Parameters
    ----------
    source, target : pyproj.CRS
        From and to.
    lat, lon : ndarray, (n,)
        Geodetic latitude and longitude, rad.

    Returns
    -------
    pyproj.transformer.TransformerGroup
        Those whose grids are there, and those that lack some.
    """
    from pyproj.transformer import TransformerGroup

    with warnings.catch_warnings(action="ignore"):  # pyproj's own words on what callers refuse
        return TransformerGroup(
            source,
            target,
            always_xy=True,
            area_of_interest=_area(lat, lon),
            allow_ballpark=False,
        )


def box_around(lat: Array, lon: Array) -> tuple[float, float, float, float]:
    """Return the sides of the area of points, at whole steps of `AROUND_DEG`.

    Parameters
    ----------
    lat, lon : ndarray, (n,)
        Geodetic latitude and longitude, rad.

    Returns
    -------
    tuple of float
        West, south, east and north, deg; the latter two without the last step.
    """
    ends = np.degrees([lon.min(), lat.min(), lon.max(), lat.max()])
    west, south, east, north = (np.floor(ends / AROUND_DEG) * AROUND_DEG).tolist()
    return west, south, east, north


def _area(lat: Array, lon: Array) -> Any:
    from pyproj.aoi import AreaOfInterest

    west, south, east, north = box_around(lat, lon)
    return AreaOfInterest(west, south, east + AROUND_DEG, min(north + AROUND_DEG, 90.0))


def lacking_plan(name: str, grids: Sequence[str], best_m: float, used_m: float, datum: str) -> str:
    """Return why nothing is projected without a grid of a datum shift, and how to get it.

    Parameters
    ----------
    name : str
        The CRS.
    grids : sequence of str
        What is missing.
    best_m, used_m : float
        Accuracies with and without it, m; negative where unknown.
    datum : str
        Name and code of the datum of the CRS.

    Returns
    -------
    str
        The message.
    """
    accuracy = f"{used_m:g} m" if used_m >= 0.0 else "an unknown accuracy"
    return (
        f"CRS {name}: the transformation to its datum is accurate to {best_m:g} m with the grid"
        f" {' and '.join(grids)}, which is not installed, and to {accuracy} without; get the grid"
        f" by {sync_commands(grids)}, or name another CRS, or the datum of the base's coordinates"
        f" where it is {datum} (gnss.datum); {DOCTOR}"
    )


def lacking_grids(
    name: str, source: Any, target: Any, lat: Array, lon: Array, subject: str = HEIGHTS
) -> str:
    """Return why heights, or the datum, of a CRS are not reached, by the grids that are missing.

    Parameters
    ----------
    name : str
        The CRS.
    source, target : pyproj.CRS
        From and to, heights included.
    lat, lon : ndarray, (n,)
        Geodetic latitude and longitude, rad.
    subject : str
        What needs the grids.

    Returns
    -------
    str
        The message, empty where no grid of PROJ's would help. Of several ways it names the one
        that lacks the fewest grids, of these the most accurate one.
    """
    remedies = []
    for operation in operations(source, target, lat, lon).unavailable_operations:
        missing = [grid for grid in operation.grids if not grid.available]
        if missing and all(grid.url for grid in missing):
            accuracy = operation.accuracy if operation.accuracy >= 0.0 else np.inf
            remedies.append((len(missing), accuracy, [grid.short_name for grid in missing]))
    if not remedies:
        return ""
    count, _, grids = min(remedies)
    noun, pronoun = ("a grid", "it") if count == 1 else ("grids", "them")
    alternative = "a geoid file and a horizontal CRS" if subject == HEIGHTS else "another CRS"
    return (
        f"CRS {name}: {subject} need{'s' * (subject != HEIGHTS)} {noun}: {' and '.join(grids)}"
        f" {'is' if count == 1 else 'are'} not installed; get {pronoun} by {sync_commands(grids)},"
        f" or name {alternative} instead; {DOCTOR}"
    )
