"""What is different from earlier flights of the same equipment, where a season.csv knows them.

The season is that of the file which the flight file includes, or of the directory above the flight:
the season.csv there that `insgnss batch` wrote. Standard deviations and the mean of the innovations
squared are compared with the median of the earlier flights, constants and biases with their mean,
of which a flight may differ by its own sigma and by what the earlier flights differ among each
other.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import InputError
from ...base.wording import relative
from ...flight.config.flight_file import Flight
from .row import BIAS_COLUMNS, Row, boresight_of, is_number, row_of
from .tables import read_season
from .trends import SLOPE_SIGMAS, TREND_QUANTITIES

SEASON_FILE = "season.csv"
# times the median of the earlier flights: flights of one kind differ by 1.3 in length and lines
USUAL_RATIO = 1.5
CHANCE_OF_DIFFERENCE = (
    1e-4  # of a bias that is as usual to be called different: 1 flight in 1600 by six axes
)
# what matters of a bias: below it, no image changes by a tenth of its sigma, deg/h and mg
PHYSICAL_BIASES = {"deg_h": 5.0, "mg": 0.5}
RATIOS = {  # name and unit by column
    **{f"sigma_{a}_mm": (f"sigma {n}", "mm") for a, n in zip("enu", ("E", "N", "U"), strict=True)},
    **{
        f"sigma_att_{a}_deg": (f"sigma of the turn about {n}", "deg")
        for a, n in zip("enu", ("E", "N", "U"), strict=True)
    },
    "nis_ratio": ("NIS of position per degree of freedom", ""),
}
REMOUNTED = "check what was remounted or bent since the earlier flights, and measure it anew"


def earlier_flights(flight: Flight, report: Mapping[str, Any]) -> dict[str, Any]:
    """Compare a flight with the earlier ones of its equipment.

    Parameters
    ----------
    flight : Flight
        The flight file.
    report : mapping
        What report.json holds.

    Returns
    -------
    dict
        The key `earlier` of report.json; empty where no season knows an earlier flight.
    """
    if not flight.included:
        return {}
    equipment = flight.included[0].resolve().with_suffix("")
    above = (equipment.parent, flight.path.resolve().parent.parent)
    table = next((file for folder in above if (file := folder / SEASON_FILE).is_file()), None)
    if table is None:
        return {}
    try:
        rows = read_season(table)
    except InputError:
        return {}  # `batch` writes it anew
    this_flight = row_of(report) | boresight_of(flight)
    earlier = [row for row in rows if _is_earlier(row, this_flight, equipment)]
    if not earlier:
        return {}
    compared = [
        *_ratios(this_flight, earlier),
        *_constants(this_flight, earlier),
        *_biases(this_flight, earlier),
    ]
    figures = {
        "equipment": equipment.name,
        "season": relative(table, flight.path.parent),
        "flights": len(earlier),
        "last_utc": max(str(row["date_utc"]) for row in earlier),
        "compared": len(compared),
        "different": [comparison for comparison in compared if comparison["differs"]],
    }
    return {"earlier": figures}


def _is_earlier(row: Row, this: Row, equipment: Path) -> bool:
    """Tell whether a row is of an earlier flight of this equipment that has a result."""
    name = Path(str(row.get("equipment") or "")).parts
    same_equipment = bool(name) and equipment.parts[-len(name) :] == name
    solved = row.get("status") in ("done", "kept")
    return same_equipment and solved and "" < str(row.get("date_utc") or "") < str(this["date_utc"])


def _values(rows: Sequence[Row], column: str) -> Any:
    """Return the numbers of a column."""
    return np.array([row[column] for row in rows if is_number(row.get(column))])


def _figure(
    name: str, unit: str, value: float, usual: float, differs: bool, help: str
) -> dict[str, Any]:
    """Return one compared figure with its unit, for `earlier` of report.json."""
    return {
        "name": name,
        "unit": unit,
        "value": float(value),
        "earlier": float(usual),
        "differs": bool(differs),
        "help": help,
    }


def _ratios(this_flight: Row, earlier: Sequence[Row]) -> list[dict[str, Any]]:
    """Compare what is positive and has no sigma with the median of the earlier flights."""
    comparisons = []
    for column, (label, unit) in RATIOS.items():
        values = _values(earlier, column)
        if values.size and is_number(this_flight.get(column)) and np.median(values) > 0.0:
            usual, value = float(np.median(values)), float(this_flight[column])
            differs = not usual / USUAL_RATIO < value < usual * USUAL_RATIO
            advice = "nothing to do" if value < usual else "see the remarks and the GNSS lines"
            comparisons.append(_figure(label, unit, value, usual, differs, advice))
    return comparisons


def _constants(this_flight: Row, earlier: Sequence[Row]) -> list[dict[str, Any]]:
    """Compare lever arm, time offset and bore-sight with their mean by weights."""
    comparisons = []
    for quantity in TREND_QUANTITIES:
        pairs = [
            (quantity.factor * row[quantity.column], quantity.factor * row[quantity.sigma])
            for row in (this_flight, *earlier)
            if is_number(row.get(quantity.column))
            and is_number(row.get(quantity.sigma))
            and row[quantity.sigma] > 0.0
        ]
        if (
            len(pairs) < 2
            or not is_number(this_flight.get(quantity.column))
            or not this_flight.get(quantity.sigma)
        ):
            continue
        (value, sigma), *pairs_before = pairs
        values, sigmas = np.array(pairs_before).T
        weights = sigmas**-2.0
        mean = float(weights @ values / weights.sum())
        scatter = max(1.0, float(weights @ (values - mean) ** 2 / max(values.size - 1, 1)))
        limit = SLOPE_SIGMAS * np.sqrt(sigma**2 + scatter / weights.sum())
        differs = abs(value - mean) > max(float(limit), quantity.physical)
        comparisons.append(
            _figure(str(quantity.state), quantity.unit, value, mean, differs, REMOUNTED)
        )
    return comparisons


def _biases(this_flight: Row, earlier: Sequence[Row]) -> list[dict[str, Any]]:
    """Compare the biases with their mean; they differ from one turn-on to the next."""
    from scipy.stats import t

    comparisons = []
    for column, (name, unit) in BIAS_COLUMNS.items():
        values = _values(earlier, column)
        if values.size < 2 or not is_number(this_flight.get(column)):
            continue
        usual = float(np.mean(values))
        count = values.size  # the next of normal values about their mean, which is not known
        spread = (
            float(np.std(values, ddof=1))
            * (1.0 + 1.0 / count) ** 0.5
            * t.isf(0.5 * CHANCE_OF_DIFFERENCE, count - 1)
        )
        physical = next(
            largest for suffix, largest in PHYSICAL_BIASES.items() if column.endswith(suffix)
        )
        value = float(this_flight[column])
        differs = abs(value - usual) > max(float(spread), physical)
        advice = "let the IMU warm up longer, and check whether the next flight differs as well"
        comparisons.append(_figure(name, unit, value, usual, differs, advice))
    return comparisons
