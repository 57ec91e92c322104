"""Units that the size of the readings allows.

Gravity fixes that of the accelerometers, the possible leaves few for the gyros. Readings that are
whole numbers are counts of a converter of 16 bits or fewer over a range of 2^k g, or of 125 to 2000
deg/s (data sheets of Bosch, InvenSense, ST); ST's gyros take 35/32.768 of that.
"""

from dataclasses import dataclass

import numpy as np

from ...base.units import DEG, STANDARD_GRAVITY
from ...records import Finding, Quantity
from .findings import MOST_CONFIDENCE, answer, unknown_property
from .signal import ImuGrid

G = STANDARD_GRAVITY
GYRO_UNITS = {"rad/s": 1.0, "deg/s": DEG, "deg/h": DEG / 3600.0}
ACCEL_UNITS = {"m/s^2": 1.0, "g": G, "mg": 1e-3 * G}
ACCEL_COUNTS = {f"{0.5**k:.12g} g": 0.5**k * G for k in range(8, 16)}
GYRO_COUNTS = {
    f"{count * 0.5**k:.12g} deg/s": count * 0.5**k * DEG
    for k in range(5)
    for count in (2e3 / 2**15, 0.07)
}
GYRO_BY_CLAIM = (1.0 / DEG, 3600.0, 3600.0 / DEG)  # what a wrong claim makes of GYRO_UNITS
ACCEL_BY_CLAIM = (1.0 / G, 1e3 / G, 1e3, 1e-3)  # what a wrong claim makes of ACCEL_UNITS
SIZE_S = 0.1  # vibration is averaged over it
LEAST_RATE, MOST_RATE = 3e-5, 30.0  # rad/s: less than half the Earth's; more than 1700 deg/s
# logarithm of gravity's size against a unit: sure, not at all, and to the next unit
GOOD_LOG_MISFIT, MOST_LOG_MISFIT, SURE_MARGIN = 0.15, 0.4, 0.5
# of counts: scale errors of small accelerometers, and to the next one
COUNT_LOG_MISFIT, COUNT_MARGIN = 0.04, 0.1


@dataclass(frozen=True, eq=False)
class ForceUnit:
    """Unit of the accelerometers.

    Parameters
    ----------
    factor : float
        To m/s^2, of the readings taken as rates.
    unit : str
    quantity : str
    of_quantity, of_unit : Finding
    """

    factor: float
    unit: str
    quantity: Quantity
    of_quantity: Finding
    of_unit: Finding


def force_unit(grid: ImuGrid) -> ForceUnit:
    """Find unit and quantity from the typical size of the specific force.

    That size is gravity's in all that flies, drives or stands.
    """
    k = min(max(1, round(SIZE_S / grid.step)), len(grid.dvel))
    n = len(grid.dvel) // k
    mean = grid.dvel[: n * k].reshape(n, k, 3).mean(axis=1) / grid.step
    size = max(float(np.median(np.linalg.norm(mean, axis=1))), 1e-12)
    candidates: list[tuple[float, str, Quantity]] = [
        (f, unit, "mean_rate") for unit, f in ACCEL_UNITS.items()
    ]
    candidates += [(1.0 / grid.interval, "m/s", "increments")]
    if grid.whole_accel:
        counts: list[tuple[float, str, Quantity]] = [
            (f, unit, "mean_rate") for unit, f in ACCEL_COUNTS.items()
        ]
        nearest = _nearest([*candidates, *counts], size)
        if nearest[0][0] < COUNT_LOG_MISFIT:
            return _counted_force(size, *nearest)
    (misfit, factor, unit, quantity), second = _nearest(candidates, size)
    if misfit > MOST_LOG_MISFIT:
        (misfit, factor, unit, quantity), second = _nearest(
            [(f, "", "mean_rate") for f in ACCEL_BY_CLAIM], size
        )
    sure = (
        MOST_CONFIDENCE
        * float(np.clip((MOST_LOG_MISFIT - misfit) / (MOST_LOG_MISFIT - GOOD_LOG_MISFIT), 0.0, 1.0))
        * (0.5 if second < misfit + SURE_MARGIN else 1.0)
    )
    if sure == 0.0:
        evidence = (
            f"the accelerometers show {size:.4g} in the median over {SIZE_S} s, which is gravity in"
            " no known unit"
        )
        return unknown_force(G / size, evidence)
    value = unit or f"{factor:.4g} m/s^2"
    evidence = (
        f"median size {size:.4g} over {SIZE_S} s, where gravity is {G / factor:.4g} {unit}".rstrip()
    )
    kind = "rates, mean or instantaneous: the data do not show which"
    if quantity == "increments":
        evidence, kind = f"{evidence} in {grid.interval:.4g} s", "increments"
    rates = "rates" if quantity == "mean_rate" else quantity
    of_quantity = answer("quantity", rates, sure, f"{kind}; {evidence}")
    of_unit = answer("accelerometer unit", value, sure, evidence)
    return ForceUnit(factor, unit or "m/s^2", quantity, of_quantity, of_unit)


def _counted_force(
    size: float, nearest: tuple[float, float, str, Quantity], second: float
) -> ForceUnit:
    """Return the unit of whole numbers, unsure where the size fits another one nearly as well."""
    misfit, factor, unit, quantity = nearest
    sure = MOST_CONFIDENCE * (1.0 if second > misfit + COUNT_MARGIN else 0.5)
    evidence = f"median size {size:.4g} of whole numbers, where gravity is {G / factor:.4g}"
    of_quantity = answer("quantity", "rates", sure, evidence)
    return ForceUnit(
        factor, unit, quantity, of_quantity, answer("accelerometer unit", unit, sure, evidence)
    )


def unknown_force(factor: float, why: str) -> ForceUnit:
    """Return the abstention, with the reason `why`."""
    of_quantity, of_unit = (
        unknown_property("quantity", why),
        unknown_property("accelerometer unit", why),
    )
    return ForceUnit(factor, "m/s^2", "mean_rate", of_quantity, of_unit)


def _nearest(
    candidates: list[tuple[float, str, Quantity]], size: float
) -> tuple[tuple[float, float, str, Quantity], float]:
    """The candidate in which `size` is most like gravity, with the logarithm it is off by.

    The second value is that logarithm of the next candidate. A candidate is factor, unit and
    quantity.
    """
    ranked = sorted(
        (abs(float(np.log(size * f / G))), f, unit, quantity) for f, unit, quantity in candidates
    )
    return ranked[0], ranked[1][0]


def gyro_factors(grid: ImuGrid, quantity: str) -> list[float]:
    """Return the factors to rad/s that make the readings rates that a drone and a gyro can have."""
    candidates = [*GYRO_UNITS.values(), *GYRO_BY_CLAIM]
    if grid.whole_gyro:
        candidates = [*GYRO_UNITS.values(), *GYRO_COUNTS.values()]
    if quantity == "increments":
        candidates = [f / grid.interval for f in candidates]
    size = np.linalg.norm(grid.dtheta, axis=1) / grid.step
    typical, most = float(np.median(size)), float(np.quantile(size, 0.99))
    return [f for f in candidates if typical * f > LEAST_RATE and most * f < MOST_RATE]


def gyro_unit(factor: float, quantity: str, interval: float) -> str:
    """Return the name of the unit with that factor; empty where a wrong claim made the factor."""
    f = abs(factor) * (interval if quantity == "increments" else 1.0)
    symbol = next(
        (unit for unit, one in (GYRO_UNITS | GYRO_COUNTS).items() if abs(np.log(f / one)) < 1e-6),
        "",
    )
    return symbol.removesuffix("/s") if quantity == "increments" else symbol
