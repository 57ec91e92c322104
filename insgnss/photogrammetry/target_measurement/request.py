"""What `insgnss targets` is asked for."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from ...base.errors import UsageError
from ...flight.config.block_file import VehicleTable
from ...io.options.kinds import Checked
from ...io.options.schema import argument

if TYPE_CHECKING:
    from ..targets.codes import Ring
    from ..targets.signals import Signal

TARGETS_DIRECTORY = "targets"


@dataclass(frozen=True)
class Target(Checked):
    """What the targets on the ground look like.

    Parameters
    ----------
    kind : str
        What it shows.
    size_m : float
        Side of a quadrant pattern or of what a picture shows, diameter of a disc and of the disc
        of a ring-coded target, length of a cross's bars, m.
    arm_m : float, optional
        Width of a cross's bars, m; by default a sixth of their length.
    dark : bool
        Whether disc, cross or ring are darker than what is about them.
    around : float, optional
        Diameter of what is even about a disc, in diameters of the disc.
    bits : int
        Number of segments of a ring.
    ring : tuple of float
        Inner and outer diameter of a ring, in diameters of its disc.
    picture : Path, optional
        Image of a target, north up.
    number : int, optional
        What the ring of a vehicle's target says; those of ground points are in their names.

    Raises
    ------
    UsageError
        A kind that is none, or a picture without its kind.
    """

    kind: Literal["quadrants", "disc", "cross", "ring", "picture"] = argument(
        "quadrants", "kind of target", cli="--signal"
    )
    size_m: float = argument(
        0.3,
        "side of a quadrant pattern or of the picture, diameter of a disc (of a ring: the disc in "
        "its middle), length of a cross's bars",
        unit="m",
        positive=True,
        cli="--size",
    )
    arm_m: float | None = argument(
        None, "width of a cross's bars", unit="m", positive=True, usual="size / 6", cli="--arm"
    )
    dark: bool = argument(False, "disc, cross or ring are darker than their background")
    around: float | None = argument(
        None,
        "diameter of the uniform background around a disc, in diameters of the disc",
        positive=True,
        usual="1.6",
        metavar="N",
    )
    bits: int = argument(12, "segments of a ring")
    ring: tuple[float, float] = argument(
        (2.0, 3.0),
        "diameters of a ring, in diameters of its disc",
        positive=True,
        metavar="INNER OUTER",
    )
    picture: Path | None = argument(None, "image of a target, north up, square")
    number: int | None = argument(
        None, "with --vehicle: number coded in the ring of the vehicle's target"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.kind == "picture") != (self.picture is not None):
            raise UsageError("targets: --picture FILE belongs to --signal picture; give both")

    @property
    def signal(self) -> "Signal":
        """The target in its plane.

        Raises
        ------
        InputError
            A size that cannot be, or a picture that shows nothing.
        """
        from ..targets.signals import cross, disc, picture, quadrants
        from .photographs import read_grey

        if self.kind == "quadrants":
            return quadrants(self.size_m)
        if self.kind == "cross":
            return cross(self.size_m, self.arm_m or self.size_m / 6.0, not self.dark)
        if self.picture is not None:
            return picture(read_grey(self.picture), self.size_m)
        # even ground ends a little before the ring does
        usual = 1.6 if self.kind == "disc" else 0.95 * self.ring[0]
        return disc(self.size_m, self.around or usual, not self.dark)

    @property
    def code(self) -> "Ring | None":
        """The ring, None of targets without code.

        Raises
        ------
        InputError
            A ring that cannot be.
        """
        from ..targets.codes import Ring

        return Ring(self.size_m, self.bits, *self.ring) if self.kind == "ring" else None


@dataclass(frozen=True)
class TargetRequest(Checked):
    """Files of a flight and what the targets look like.

    Parameters
    ----------
    eo, ground, camera : Path
        eo.json, ground points and camera.toml.
    images : Path, optional
        Directory of the photographs; predictions go without.
    crs : str, optional
        CRS of the ground points; None: the tangent plane of the orientation, or what the file says.
    geoid : Path, optional
        Grid of geoid heights.
    target : Target
        What the targets look like.
    search_px : float
        Standard deviation that is added to both coordinates of a prediction, pixels: what the
        covariances do not know.
    whole : bool
        Whether predictions list points that are not seen, too.
    vehicle : VehicleTable, optional
        The target is on a vehicle, whose file is `ground`: table [vehicle] of a block file.

    Raises
    ------
    UsageError
        A file that is not there.
    """

    eo: Path = argument(..., "eo.json of a processed flight", cli="EO")
    ground: Path = argument(
        ...,
        "ground points: a table, or a program's file; with --vehicle where the vehicle was",
        cli="GROUND",
    )
    camera: Path = argument(..., "camera.toml", cli="CAMERA")
    images: Path | None = argument(None, "of measure: directory of the photographs", cli="IMAGES")
    crs: str | None = argument(
        None,
        "of the ground points, such as EPSG:2056+5728",
        usual="the tangent plane of EO",
        metavar="CRS",
    )
    geoid: Path | None = argument(
        None, "grid of geoid heights, for heights above it", metavar="GRID"
    )
    target: Target = field(default_factory=Target)
    search_px: float = argument(
        0.0,
        "standard deviation added to both coordinates of a prediction",
        unit="px",
        low=0.0,
        high=1000.0,
    )
    whole: bool = argument(False, "predict: list points that are not seen, too")
    vehicle: VehicleTable | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        named: dict[str, Path | None] = {"EO": self.eo, "GROUND": self.ground}
        named |= {
            "CAMERA": self.camera,
            "IMAGES": self.images,
            "--geoid": self.geoid,
            "--picture": self.target.picture,
        }
        for name, path in named.items():
            if path is not None and not path.exists():
                raise UsageError(f"targets: {name} {path} does not exist; check the path")
        if self.vehicle is not None and self.target.kind == "ring" and self.target.number is None:
            raise UsageError(
                "targets: --number is missing: give the number coded in the ring of the vehicle's"
                " target (its points are named after the images)"
            )
