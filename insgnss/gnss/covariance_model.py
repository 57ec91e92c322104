"""Table gnss.covariance: the numbers that calibrate covariances of PPK.

sigma'^2 = (k sigma)^2 + floor^2 + (ppm distance)^2 on each axis, k and floor by class. What the
classes are, and where the numbers come from, stands in
`navigation.prepare.fix_covariance.classes`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

from ..base.errors import OptionError
from ..io.options.kinds import check
from ..io.options.schema import Triple, option
from ..navigation.prepare.fix_covariance.numbers import CLASSES, MEASURED, CalibrationNumbers

LARGEST_FACTOR = 1000.0
"""Beyond it no factor, floor (m), ppm or acceleration (m/s^2) has a meaning."""


def _classes() -> tuple[str, ...]:
    return CLASSES


@dataclass(frozen=True)
class CovarianceModel(CalibrationNumbers):
    """Numbers of (V.1) to (V.6) of `navigation.prepare.fix_covariance.classes`, as options.

    Triples are north, east, down.
    """

    scale: Mapping[str, Triple] = option(
        lambda: dict(MEASURED.scale),
        "factor k of the engine's standard deviations, a table by class",
        kind="triples",
        low=0.0,
        high=LARGEST_FACTOR,
        members=_classes,
        usual="below",
    )
    floor_m: Mapping[str, Triple] = option(
        lambda: dict(MEASURED.floor_m),
        "floor, a table by class",
        kind="triples",
        unit="m",
        low=0.0,
        high=LARGEST_FACTOR,
        members=_classes,
        usual="below",
    )
    ppm: Triple = option(
        MEASURED.ppm,
        "parts per million of the distance to the base",
        kind="triple",
        low=0.0,
        high=LARGEST_FACTOR,
    )
    acceleration_mps2: Triple = option(
        MEASURED.acceleration_mps2,
        "largest acceleration; a single epoch that needs more to lie on the path is an outlier",
        kind="triple",
        unit="m/s^2",
        low=0.0,
        high=LARGEST_FACTOR,
    )
    least_satellites: int = option(
        MEASURED.least_satellites,
        "least number of satellites of a fixed epoch that is validated",
        low=4,
        high=99,
    )
    unsupported_satellites: int = option(
        MEASURED.unsupported_satellites,
        "with fewer satellites an epoch that nothing confirms is unsupported",
        low=4,
        high=99,
    )
    support_s: float = option(
        MEASURED.support_s,
        "time to either side within which neighbours confirm an epoch",
        unit="s",
        low=0.0,
        high=600.0,
    )
    support_share: float = option(
        MEASURED.support_share,
        "share of the epochs within support_s that must be fixed as well",
        low=0.0,
        high=1.0,
    )
    island_s: float = option(
        MEASURED.island_s,
        "time to either side in which island_share of the epochs must be fixed where forward and "
        "backward do not both fix an island; 0 switches that off",
        unit="s",
        low=0.0,
        high=3600.0,
    )
    island_share: float = option(
        MEASURED.island_share,
        "share of the epochs within island_s that must be fixed; half of it of a ready `.pos`",
        low=0.0,
        high=1.0,
    )
    degraded_s: float = option(
        MEASURED.degraded_s,
        "time to either side in which a degraded epoch shows",
        unit="s",
        low=0.0,
        high=3600.0,
    )
    degraded_share: float = option(
        MEASURED.degraded_share,
        "fixed epochs with a smaller share of validated ones within degraded_s are degraded; "
        "epochs before the first and after the last validated one do not count; 0 "
        "switches that off",
        low=0.0,
        high=1.0,
    )
    gate: float = option(
        MEASURED.gate,
        "chi-square of three of forward against backward: beyond it a fixed epoch is not validated",
        low=1.0,
        high=1e4,
    )

    def __post_init__(self) -> None:
        check(self, TABLE)
        for name in ("scale", "floor_m"):
            if missing := set(CLASSES) - set(getattr(self, name)):
                problem = f"has one line for each of {', '.join(CLASSES)}"
                raise OptionError(f"{TABLE}.{name}", f"{problem}; {min(missing)!r} is missing")

    def with_changes(self, changes: Mapping[str, Any]) -> "CovarianceModel":
        """The model with some numbers replaced.

        Parameters
        ----------
        changes : Mapping[str, Any]
            Values of the fields; of `scale` and `floor_m` a table of some classes.

        Raises
        ------
        OptionError
            For a field or a value that cannot be.
        """
        field_names = {f.name for f in fields(self)}
        if odd := set(changes) - field_names:
            problem = f"{sorted(odd)[0]!r} is unknown; known are {', '.join(sorted(field_names))}"
            raise OptionError(TABLE, problem)
        tables = {
            key: {**getattr(self, key), **changes[key]}
            for key in ("scale", "floor_m")
            if key in changes
        }
        return replace(self, **{**changes, **tables})


TABLE = "gnss.covariance"


MODEL = CovarianceModel()
