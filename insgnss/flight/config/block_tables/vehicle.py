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
        "file of the vehicle's positions: `eo.json` of `process` with the exposures as events "
        "(its camera is the target), its `trajectory.csv`, or a table of positions of the target "
        "(target_positions.md)",
        cli="--vehicle",
        cli_meaning="trajectory.csv, eo.json or table of target positions of a vehicle",
    )
    target: str = option(
        "K_",
        "name of the target in the image observations: a prefix to the image name (K_IMG_0010), "
        "or one name, which is a different point in each image",
    )
    target_m: Triple | None = option(
        None,
        "lever arm from the point of the trajectory (of eo.json: the camera) to the target, "
        "forward, right, down in vehicle axes",
        unit="m",
        kind="lever",
        usual="zero of eo.json and of a table",
        needs=("file",),
    )
    target_sigma_m: Triple | None = sigmas(
        "a-priori standard deviations of the estimated correction of the lever arm target_m",
        usual="it is as stated",
        needs=("file",),
    )
    time_offset_s: float = option(
        0.0, "time offset added to the time stamps of the vehicle", unit="s", low=-1e6, high=1e6
    )
    time_offset_sigma_s: float = option(
        0.0,
        "a-priori standard deviation of the estimated delay of the vehicle's clock; 0: none",
        unit="s",
        low=0.0,
        high=10.0,
    )
    shift_sigma_m: Triple | None = sigmas(
        "a-priori standard deviations of the estimated shift of the vehicle, east, north, up",
        usual="none",
        needs=("file",),
    )
    correlated_share: float = option(
        0.75,
        "time-correlated share of the variances of trajectory.csv or a table "
        "(correlation_time_s); the remainder is white; eo.json has its own covariance",
        low=0.0,
        high=1.0,
    )
    correlation_time_s: float = option(
        300.0, "correlation time of the time-correlated share", unit="s", low=0.01, high=1e6
    )
    longest_gap_s: float = option(
        1.0,
        "longest interval between two rows of the file that is interpolated; exposures in longer "
        "intervals have no target",
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
        "a-priori standard deviation of the estimated error of the size size_m; 0: exact",
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
            raise OptionError(
                "vehicle.target",
                "is empty; give a prefix of the target's points, such as K_, or their name",
            )
