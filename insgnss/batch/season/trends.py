"""Constants of an equipment over a season: do they drift, do they scatter, or is nothing to tell?

A flight k at time t_k gives the value y_k of a constant with a standard deviation s_k. A straight
line by weighted least squares,

    y_k = a + b (t_k - t_0) + e_k,  w_k = s_k^-2,  b = sum w (t - t_0) y / sum w (t - t_0)^2  (T.1)
    var b = max(1, X) / sum w (t - t_0)^2,  X = sum w (y - line)^2 / (n - 2)                  (T.2)

with t_0 the weighted mean of the times: errors that the flights do not claim widen var b, and
flights that claim too much never narrow it. A drift is named where |b| exceeds `SLOPE_SIGMAS` of
its standard deviations and moves the constant, over the season, by more than what matters
(`PHYSICAL`); a scatter where X exceeds what chance leaves in one of `SCATTER_CHANCE` seasons
(chi-square) and the flights differ by more than what matters. With fewer than `FEWEST_FLIGHTS`
flights nothing is said.

The limits are physical because fixes of one base share errors of some millimetres that no flight's
covariance holds.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Literal

import numpy as np

from ...base.quantiles import chi_square_quantile
from ...geodesy.gpstime import DAY_S
from ...records import Array
from ...records.states import LEVER_ARM, TIME_OFFSET, State
from .row import LEVER_ARM_COLUMNS, Row, is_number

FEWEST_FLIGHTS = 8  # flights
SLOPE_SIGMAS = 4.0  # standard deviations of the slope
SCATTER_CHANCE = 1e4  # seasons in one of which chance alone makes a scatter (chosen)
MONTH_DAYS = 30.4375  # days of a mean month: 365.25 / 12
Finding = Literal["drift", "scatter", "steady", "too few", "one time"]


@dataclass(frozen=True)
class Quantity:
    """A column of the season that belongs to an equipment.

    Parameters
    ----------
    state : State
        What it is, in the unit of the columns.
    columns : str
        The beginning of the names of its columns.
    factor : float
        From the columns' unit to the one that is shown.
    unit : str
        That one.
    physical : float
        What matters, in the shown unit.
    """

    state: State
    columns: str
    factor: float
    unit: str
    physical: float

    @property
    def column(self) -> str:
        """The column of the value."""
        return f"{self.columns}_{self.state.unit}"

    @property
    def sigma(self) -> str:
        """The column of its standard deviation."""
        return f"{self.columns}_sigma_{self.state.unit}"


BORESIGHT = "bore-sight"
_SHOWN = {
    LEVER_ARM: (1e3, "mm", 5.0),
    TIME_OFFSET.group: (1e3, "ms", 1.0),
    BORESIGHT: (1.0, "deg", 0.02),
}
_BORESIGHTS = {State(BORESIGHT, axis, "deg"): f"boresight_{axis}" for axis in "xyz"}
TREND_QUANTITIES = tuple(
    Quantity(state, columns, *_SHOWN[state.group])
    for state, columns in {**LEVER_ARM_COLUMNS, **_BORESIGHTS}.items()
)


@dataclass(frozen=True)
class SeasonTrend:
    """A constant of an equipment over the season.

    Parameters
    ----------
    equipment : str
        Name of the shared file, "" of flights without one.
    quantity : Quantity
        Which constant.
    days : Array
        (n,) since the first flight of the season.
    value, sigma : Array
        (n,) of the flights, in the quantity's unit.
    names : tuple of str
        (n,) the flights.
    finding : str
        "drift", "scatter", "steady", "too few" flights, or all at "one time".
    slope, slope_sigma : float
        In the unit a day; NaN without a line.
    level : float
        Value of the line at the first day.
    chi_square : float
        X of (T.2); NaN without a line.
    """

    equipment: str
    quantity: Quantity
    days: Array
    value: Array
    sigma: Array
    names: tuple[str, ...]
    finding: Finding
    slope: float = float("nan")
    slope_sigma: float = float("nan")
    level: float = float("nan")
    chi_square: float = float("nan")

    @property
    def odd(self) -> bool:
        """Whether something is named."""
        return self.finding in ("drift", "scatter")

    def sentence(self) -> str:
        """Return what is said of it, without full stop."""
        q = self.quantity
        name = f"{q.state} of {self.equipment or 'the flights without a shared file'}"
        span = float(np.ptp(self.days)) if self.days.size else 0.0
        if self.finding == "drift":
            monthly, sigma = MONTH_DAYS * self.slope, MONTH_DAYS * self.slope_sigma
            return (
                f"the {name} drifts by {monthly:+.3g} +- {sigma:.2g} {q.unit} a month, "
                f"{abs(self.slope) * span:.3g} {q.unit} over {span:.0f} days "
                f"({abs(self.slope / self.slope_sigma):.1f} sigma, {self.days.size} flights); "
                "look for parts that loosen or age, and calibrate the mounting anew"
            )
        if self.finding == "scatter":
            worst = int(np.argmax(np.abs(self.residual / self.sigma)))
            return (
                f"the {name} differs from flight to flight by more than its sigmas "
                f"({self.chi_square:.1f} times in variance, {self.days.size} flights), most in "
                f"{self.names[worst]} ({self.residual[worst]:+.3g} {q.unit} off the line); check "
                "what was remounted or bent between flights"
            )
        if self.finding == "steady":
            return f"the {name} shows no drift ({self.days.size} flights)"
        few = f"{self.days.size} flights, and a trend needs {FEWEST_FLIGHTS}"
        why = few if self.finding == "too few" else "all flights are of the same time"
        return f"no trend of the {name} can be computed: {why}"

    @property
    def residual(self) -> Array:
        """(n,) values less the line."""
        return np.asarray(self.value - self.level - self.slope * self.days)


def fit(days: Array, value: Array, sigma: Array) -> tuple[float, float, float, float]:
    """Return slope, its standard deviation, the value at day 0 and X of (T.1) and (T.2).

    Parameters
    ----------
    days : (n,) times.
    value, sigma : (n,) values and their standard deviations.
    """
    w = sigma**-2.0
    mean = float(w @ days / w.sum())
    t = days - mean
    spread = float(w @ t**2)
    slope = float(w @ (t * value) / spread)
    level = float(w @ value / w.sum())
    residual = value - level - slope * t
    chi_square = float(w @ residual**2 / (days.size - 2))
    return slope, (max(1.0, chi_square) / spread) ** 0.5, level - slope * mean, chi_square


def judge_trend(
    equipment: str,
    quantity: Quantity,
    days: Array,
    value: Array,
    sigma: Array,
    names: Sequence[str],
) -> SeasonTrend:
    """Return the trend of a constant, with its finding.

    Parameters
    ----------
    equipment : name of the shared file.
    quantity : the constant.
    days : (n,) times.
    value, sigma : (n,) in the unit of the quantity.
    names : (n,) flights.
    """
    values = (equipment, quantity, days, value, sigma, tuple(names))
    if days.size < FEWEST_FLIGHTS:
        return SeasonTrend(*values, "too few")
    span = float(np.ptp(days))
    if span * DAY_S < 1.0:
        return SeasonTrend(*values, "one time")
    slope, slope_sigma, level, x = fit(days, value, sigma)
    finding: Finding = "steady"
    residual = value - level - slope * days
    limit = chi_square_quantile(days.size - 2, 1.0 / SCATTER_CHANCE) / (days.size - 2)
    if abs(slope) > SLOPE_SIGMAS * slope_sigma and abs(slope) * span > quantity.physical:
        finding = "drift"
    elif x > limit and float(np.abs(residual).max()) > quantity.physical:
        finding = "scatter"
    return SeasonTrend(*values, finding, slope, slope_sigma, level, x)


def trends(rows: Iterable[Row]) -> list[SeasonTrend]:
    """Return the trends of every equipment of a season.

    Parameters
    ----------
    rows : iterable of dict
        Rows of the table; those that lack date or sigma are left out. A flight that failed has them
        where it was refused because of these constants.

    Returns
    -------
    list of SeasonTrend
        By equipment, then in the order of `TREND_QUANTITIES`; a bore-sight has one where
        calibrations gave it.
    """
    usable = [row for row in rows if row.get("date_utc")]
    if not usable:
        return []
    first = min(_days(row) for row in usable)
    out = []
    for equipment in dict.fromkeys(str(row.get("equipment") or "") for row in usable):
        of_equipment = [row for row in usable if str(row.get("equipment") or "") == equipment]
        for q in TREND_QUANTITIES:
            with_it = [
                r for r in of_equipment if is_number(r.get(q.column)) and is_number(r.get(q.sigma))
            ]
            with_it = _calibrations(with_it, q) if q.state.group == BORESIGHT else with_it
            if not with_it:
                continue
            with_it.sort(key=_days)
            days = np.array([_days(row) - first for row in with_it])
            value = np.array([q.factor * row[q.column] for row in with_it])
            sigma = np.array([q.factor * row[q.sigma] for row in with_it])
            names = [str(row["name"]) for row in with_it]
            out.append(judge_trend(equipment, q, days, value, sigma, names))
    return out


def _calibrations(rows: Sequence[Row], quantity: Quantity) -> list[Row]:
    """Return the first flight of each calibration: a value that many share is one measurement."""
    first: dict[tuple[Any, Any], Row] = {}
    for row in sorted(rows, key=_days):
        first.setdefault((row[quantity.column], row[quantity.sigma]), row)
    return list(first.values())


def _days(row: Row) -> float:
    return datetime.fromisoformat(str(row["date_utc"])).timestamp() / DAY_S
