"""Table [vehicle] of the block file."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ....base.errors import OptionError
from ....io.options.kinds import Checked
from ....io.options.schema import Triple, columns_of_file, option, sigmas

if TYPE_CHECKING:
    from ....base.tables import Columns


@dataclass(frozen=True)
class VehicleTable(Checked, table="vehicle"):
    """Table [vehicle]: a vehicle on the ground whose target the images see: kinematic control."""

    file: Path | None = option(
        None,
        "where the vehicle was: `eo.json` of a run of `process` with the exposures of the images "
        "as its events (its camera is the target), `trajectory.csv` of one, or a table of "
        "positions of the target (target_positions.md)",
        cli="--vehicle",
        cli_meaning="trajectory.csv, eo.json or table of target positions of a vehicle",
    )
    target: str = option(
        "K_",
        "name of the target in the image observations: a prefix before the name of the image"
        " (K_IMG_0010), or one name in all images, then taken as another point in each image",
    )
    target_m: Triple | None = option(
        None,
        "vector from the point of the trajectory (of eo.json: from its camera) to the target,"
        " forward, right, down in the axes of the vehicle",
        unit="m",
        kind="lever",
        usual="zero of eo.json and of a table",
        needs=("file",),
    )
    target_sigma_m: Triple | None = sigmas(
        "a-priori standard deviations of a correction of target_m that the adjustment estimates",
        usual="it is as stated",
        needs=("file",),
    )
    time_offset_s: float = option(
        0.0, "seconds that are added to the stamps of the vehicle", unit="s", low=-1e6, high=1e6
    )
    time_offset_sigma_s: float = option(
        0.0,
        "standard deviation of the delay of the vehicle's clock, which is estimated; 0: it is as "
        "stated",
        unit="s",
        low=0.0,
        high=10.0,
    )
    shift_sigma_m: Triple | None = sigmas(
        "standard deviations of a shift of all positions of the vehicle, east, north, up, which is "
        "estimated",
        usual="none",
        needs=("file",),
    )
    correlated_share: float = option(
        0.75,
        "for trajectory.csv and a table: time-correlated share of the variances"
        " (correlation_time_s); the rest is white. eo.json has its own covariance",
        low=0.0,
        high=1.0,
    )
    correlation_time_s: float = option(
        300.0, "correlation time of the time-correlated share", unit="s", low=0.01, high=1e6
    )
    longest_gap_s: float = option(
        1.0,
        "longest time between two rows of the file within which it is interpolated; exposures in a "
        "longer one have no target",
        unit="s",
        low=0.001,
        high=100.0,
    )
    sizes: Path | None = option(
        None,
        "apparent sizes of the target (target_sizes.md), with size_m",
        kind="existing",
        form="file",
        needs=("file", "size_m"),
    )
    size_m: float | None = option(
        None, "diameter of the target", unit="m", positive=True, usual="not known", needs=("sizes",)
    )
    size_sigma_m: float = option(
        0.0,
        "a-priori standard deviation of the error of size_m, which is estimated; 0: size_m is"
        " exact",
        unit="m",
        low=0.0,
        high=10.0,
    )
    skip: tuple[str, ...] = option((), "names of images whose target is left out")
    crs: str | None = option(
        None, "of a table: its CRS, as ground.crs", usual="the tangent plane of the images"
    )
    geoid: Path | None = option(None, "of a table: as ground.geoid", needs=("crs",))
    columns: "Columns" = columns_of_file("of a table, as images.columns")

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.target.strip():
            raise OptionError("vehicle.target", "is empty; give a prefix, such as K_, or a name")
