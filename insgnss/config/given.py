"""Records instead of files: what a caller may give where a flight file names a file."""

from collections.abc import Callable
from pathlib import Path
from typing import Any


def take_record(table: Any, name: str, record_of: Callable[[Any], Any]) -> None:
    """Turn what replaces a file into a record, and a text into a path.

    Parameters
    ----------
    table : dataclass
        The frozen dataclass whose field it is, at its birth.
    name : str
        The field.
    record_of : function
        Makes the record of an array, a table or a record.
    """
    value = getattr(table, name)
    if isinstance(value, str):
        object.__setattr__(table, name, Path(value))
    elif value is not None and not isinstance(value, Path):
        object.__setattr__(table, name, record_of(value))


def imu_record(given: Any, quantity: Any) -> Any:
    """The samples of an array, a table or a record."""
    from ..records import imu_samples

    return imu_samples(given, quantity)


def gnss_record(given: Any, sigma_m: Any, sigma_velocity_mps: Any) -> Any:
    """The fixes of an array, a table or a record; sigmas are of those that have none."""
    from ..records import GnssFixes, gnss_fixes

    if isinstance(given, GnssFixes):
        return given
    return gnss_fixes(given, sigma_m, sigma_velocity_mps)


def event_record(given: Any) -> Any:
    """The exposures of an array, a table or a record."""
    from ..records import camera_events

    return camera_events(given)
