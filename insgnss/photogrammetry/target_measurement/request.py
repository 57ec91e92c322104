"""What `insgnss targets` is asked for."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ...base.errors import UsageError, near
from ...flight.config.block_file import VehicleTable
from ..targets.codes import Ring
from ..targets.signals import Signal, cross, disc, picture, quadrants

KINDS = ("quadrants", "disc", "cross", "ring", "picture")
DIRECTORY = "targets"


@dataclass(frozen=True)
class Target:
    """What the targets on the ground look like.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
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

    kind: str = "quadrants"
    size_m: float = 0.3
    arm_m: float | None = None
    dark: bool = False
    around: float | None = None
    bits: int = 12
    ring: tuple[float, float] = (2.0, 3.0)
    picture: Path | None = None
    number: int | None = None

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise UsageError(f"targets: --signal {self.kind!r}; {near(self.kind, KINDS)}")
        if (self.kind == "picture") != (self.picture is not None):
            raise UsageError("targets: --picture FILE belongs to --signal picture; give both")

    @property
    def signal(self) -> Signal:
        """The target in its plane.

        Raises
        ------
        InputError
            A size that cannot be, or a picture that shows nothing.
        """
        if self.kind == "quadrants":
            return quadrants(self.size_m)
        if self.kind == "cross":
            return cross(self.size_m, self.arm_m or self.size_m / 6.0, not self.dark)
        if self.kind == "picture":
            return picture(_grey(self.picture), self.size_m)
        # even ground ends a little before the ring does
        usual = 1.6 if self.kind == "disc" else 0.95 * self.ring[0]
        return disc(self.size_m, self.around or usual, not self.dark)

    @property
    def code(self) -> Ring | None:
        """The ring, None of targets without code.

        Raises
        ------
        InputError
            A ring that cannot be.
        """
        return Ring(self.size_m, self.bits, *self.ring) if self.kind == "ring" else None


@dataclass(frozen=True)
class Request:
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

    eo: Path
    ground: Path
    camera: Path
    images: Path | None = None
    crs: str | None = None
    geoid: Path | None = None
    target: Target = field(default_factory=Target)
    search_px: float = 0.0
    whole: bool = False
    vehicle: VehicleTable | None = None

    def __post_init__(self) -> None:
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
        if not 0.0 <= self.search_px <= 1000.0:
            raise UsageError(f"targets: --search-px {self.search_px:g}; 0 to 1000 px")
        if self.vehicle is not None and self.target.kind == "ring" and self.target.number is None:
            raise UsageError(
                "targets: --number is missing: what the ring of the vehicle's target says; names of"
                " its points are those of images"
            )


def _grey(path: Path | None) -> np.ndarray:
    from .photographs import read_grey

    assert path is not None
    return read_grey(path)
