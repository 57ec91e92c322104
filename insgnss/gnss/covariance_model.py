"""Table gnss.covariance: the numbers that calibrate covariances of PPK.

sigma'^2 = (k sigma)^2 + floor^2 + (ppm distance)^2 on each axis, k and floor by class. What the
classes are, and where the numbers come from, stands in
`navigation.prepare.fix_covariance.classes`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any

from ..base.errors import OptionError
from ..io.options.kinds import check
from ..io.options.schema import Triple, option
from ..navigation.prepare.fix_covariance.numbers import FIX_CLASSES, MEASURED, CalibrationNumbers

LARGEST_FACTOR = 1000.0
"""Beyond it no factor, floor (m), ppm or acceleration (m/s^2) has a meaning."""


def _classes() -> tuple[str, ...]:
    return FIX_CLASSES


_TRIPLE: dict[str, Any] = {"kind": "triple", "low": 0.0, "high": LARGEST_FACTOR}
_BY_CLASS = _TRIPLE | {"kind": "triples", "members": _classes, "usual": "below"}
_satellites = partial(option, low=4, high=99)
_share = partial(option, low=0.0, high=1.0)
_time = partial(option, unit="s", low=0.0, high=3600.0)


@dataclass(frozen=True)
class CovarianceModel(CalibrationNumbers):
    """Numbers of (V.1) to (V.6) of `navigation.prepare.fix_covariance.classes`, as options.

    Triples are north, east, down.
    """

    scale: Mapping[str, Triple] = option(
        lambda: dict(MEASURED.scale),
        "factor k on the engine's standard deviations, a table by class of epochs",
        **_BY_CLASS,
    )
    floor_m: Mapping[str, Triple] = option(
        lambda: dict(MEASURED.floor_m), "floor, a table by class", unit="m", **_BY_CLASS
    )
    ppm: Triple = option(
        MEASURED.ppm, "error proportional to the distance to the base, parts per million", **_TRIPLE
    )
    acceleration_mps2: Triple = option(
        MEASURED.acceleration_mps2,
        "largest acceleration of the antenna; a single epoch that would need more is an outlier",
        unit="m/s^2",
        **_TRIPLE,
    )
    least_satellites: int = _satellites(
        MEASURED.least_satellites, "least number of satellites of a fixed epoch that is validated"
    )
    unsupported_satellites: int = _satellites(
        MEASURED.unsupported_satellites,
        "number of satellites below which an unconfirmed epoch counts as unsupported",
    )
    support_s: float = _time(
        MEASURED.support_s,
        "time before and after an epoch within which neighbours confirm it",
        high=600.0,
    )
    support_share: float = _share(
        MEASURED.support_share, "share of the epochs within support_s that must be fixed too"
    )
    island_s: float = _time(
        MEASURED.island_s,
        "time before and after an island of fixed epochs in which island_share of the epochs must"
        " be fixed, unless forward and backward solution both fix the island; 0 switches this off",
    )
    island_share: float = _share(
        MEASURED.island_share,
        "share of the epochs within island_s that must be fixed; half this share for a ready"
        " `.pos`",
    )
    degraded_s: float = _time(
        MEASURED.degraded_s, "time before and after an epoch over which degraded_share is counted"
    )
    degraded_share: float = _share(
        MEASURED.degraded_share,
        "share of validated epochs within degraded_s below which fixed epochs count as degraded;"
        " epochs before the first and after the last validated one do not count; 0 switches this"
        " off",
    )
    gate: float = option(
        MEASURED.gate,
        "limit of the chi-square (3 degrees of freedom) of forward minus backward solution; a"
        " fixed epoch above the limit is not validated",
        low=1.0,
        high=1e4,
    )

    def __post_init__(self) -> None:
        check(self, COVARIANCE_TABLE)
        for name in ("scale", "floor_m"):
            if missing := set(FIX_CLASSES) - set(getattr(self, name)):
                problem = f"has one line for each of {', '.join(FIX_CLASSES)}"
                raise OptionError(
                    f"{COVARIANCE_TABLE}.{name}", f"{problem}; {min(missing)!r} is missing"
                )

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
        if unknown := set(changes) - field_names:
            problem = (
                f"{sorted(unknown)[0]!r} is unknown; known are {', '.join(sorted(field_names))}"
            )
            raise OptionError(COVARIANCE_TABLE, problem)
        tables = {
            key: {**getattr(self, key), **changes[key]}
            for key in ("scale", "floor_m")
            if key in changes
        }
        return replace(self, **{**changes, **tables})


COVARIANCE_TABLE = "gnss.covariance"


MODEL = CovarianceModel()
