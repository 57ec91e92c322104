"""One input of a flight as its flight file will name it, and which inputs run on one clock."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from ...io.formats.text.units import unit_factor
from ...navigation.recognise.claims import ticks_of_counter
from ...navigation.recognise.recognition import Recognition
from ...records import GnssFixes, ImuSamples

Role = Literal["imu", "gnss", "events", "gyro", "accel"]  # the last two: half an IMU

SINGLE_POINT = {"sigma_m": [2.5, 2.5, 5.0], "sigma_velocity_mps": [0.3, 0.3, 0.3]}
NO_SIGMA = (
    "the file has no standard deviations; the values are typical of a single-point receiver; for "
    "RTK write 0.02, 0.02, 0.04"
)
STEP_REASON = "the clock's usual step is"
SAME_LENGTH = 0.1  # of the logarithm to base ten: recordings end up to a quarter apart
OVERLAP = 0.3  # of the shorter recording, for two clocks to be the same


@dataclass(frozen=True)
class Keys:
    """Keys of the flight file's table, each with the reason; both grow as they are found."""

    keys: dict[str, Any] = field(default_factory=dict)
    why: dict[str, str] = field(default_factory=dict)

    def set(self, key: str, value: Any, reason: str) -> None:
        """Set a key with its reason."""
        self.keys[key], self.why[key] = value, reason

    def set_unit(self, of: str, unit: str, reason: str) -> None:
        """Set a unit and add its reason to those of the others."""
        reasons = [self.why["units"], reason] if "units" in self.why else [reason]
        self.set("units", {**self.keys.get("units", {}), of: unit}, "; ".join(reasons))


class LeftOut(NamedTuple):
    """A file that is no input, and why; of one that cannot be read its `problem` without the path,
    else "".
    """

    path: Path
    why: str
    problem: str = ""


@dataclass(frozen=True)
class InputSource:
    """One input as the flight file will name it: keys of its table, each with the reason.

    Parameters
    ----------
    role : str
    path : Path
    what : str
        A short description.
    keys, why : dict
        Keys of the flight file's table, and the reason of each.
    span : tuple of float, s, or None
        First and last stamp on the file's own clock, where a table gives them.
    other_clocks : tuple of InputSource
        The same source stamped by another of its clocks.
    header_units : dict of str to str, or None
        Of gyro and accel, as far as the file gives them; None where the format fixes them.
    free_height : bool
        Whether nothing in the file gives what the heights are above.
    axes : str
        Of the format's convention.
    site : tuple of float, or None
        Latitude deg, longitude deg, height m that the file gives for a stationary sensor.
    columns_left_out : tuple of str
        Columns of its table that no input takes, with the reason of some.
    fields : dict of str to str
        Of half an IMU: what its file calls each of its columns.
    """

    role: Role
    path: Path
    what: str
    keys: dict[str, Any] = field(default_factory=dict)
    why: dict[str, str] = field(default_factory=dict)
    span: tuple[float, float] | None = None
    other_clocks: tuple["InputSource", ...] = ()
    header_units: dict[str, str] | None = None
    free_height: bool = False
    axes: str = ""
    site: tuple[float, float, float] | None = None
    columns_left_out: tuple[str, ...] = ()
    fields: dict[str, str] = field(default_factory=dict)

    @property
    def title(self) -> str:
        """Path, and the variable inside it."""
        return (
            f"{self.path} ({self.keys['variable']})" if "variable" in self.keys else str(self.path)
        )


def on_one_clock(imu: InputSource, gnss: InputSource) -> tuple[InputSource, InputSource]:
    """Choose the clocks of samples and fixes that run together.

    Their first clocks are taken where none do, or where it is not known.
    """
    pairs = [(i, g) for g in (gnss, *gnss.other_clocks) for i in (imu, *imu.other_clocks)]
    chosen = max(pairs, key=lambda pair: overlap(pair[0].span, pair[1].span))
    if chosen == (imu, gnss) or overlap(chosen[0].span, chosen[1].span) < OVERLAP:
        return imu, gnss
    why = {"columns": f"{chosen[1].why.get('columns', '')}; the time columns in which both overlap"}
    return chosen[0], replace(chosen[1], why=chosen[1].why | why)


def as_long_as(imu: InputSource, samples: ImuSamples, fixes: GnssFixes) -> InputSource:
    """Correct the unit of the samples' clock where they would run ten or more times off the fixes.

    The unit becomes tens, hundreds ... or tenths of that which its steps suggest, where only so it
    runs as long as the fixes: within `SAME_LENGTH` of the logarithm to base ten. A unit that the
    header gives is kept.
    """
    unit = imu.keys.get("units", {}).get("time", "s")
    if STEP_REASON not in imu.why.get("units", "") or unit not in ("s", "ms", "us", "ns"):
        return imu
    ratio = np.log10(
        (samples.time[-1] - samples.time[0]) / max(fixes.time[-1] - fixes.time[0], 1e-3)
    )
    decade = round(float(ratio))
    if decade == 0 or abs(ratio - decade) > SAME_LENGTH:
        return imu
    comparison = f"in {unit} the IMU would record {10.0**ratio:.3g} times as long as the receiver"
    units = {**imu.keys["units"], "time": f"{10.0**-decade:g} {unit}"}
    return replace(
        imu,
        keys=imu.keys | {"units": units},
        why=imu.why | {"units": f"{imu.why['units']}; {comparison}"},
    )


def in_ticks(
    imu: InputSource,
    samples: ImuSamples,
    fixes: GnssFixes | None,
    recognition: Recognition | None,
) -> InputSource:
    """Correct the unit of the samples' clock where the stamps count the ticks of a counter.

    A unit that the header gives is kept.
    """
    unit = imu.keys.get("units", {}).get("time", "s")
    if fixes is None or recognition is None or STEP_REASON not in imu.why.get("units", ""):
        return imu
    counter = ticks_of_counter(samples, fixes, unit_factor(unit, "time"), recognition)
    if counter is None:
        return imu
    hertz, evidence = counter
    units = {**imu.keys["units"], "time": f"{1e6 / hertz:.12g} us"}
    why = imu.why | {"units": f"{imu.why['units']}; {evidence}"}
    return replace(imu, keys=imu.keys | {"units": units}, why=why)


def overlap(a: tuple[float, float] | None, b: tuple[float, float] | None) -> float:
    """Return the common time over the length of the shorter span, at most 1.

    It is negative without any, and 0 where one span is not known.
    """
    if a is None or b is None:
        return 0.0
    return min((min(a[1], b[1]) - max(a[0], b[0])) / max(min(a[1] - a[0], b[1] - b[0]), 1.0), 1.0)
