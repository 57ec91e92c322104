"""What the flight of an orientation was processed with, as the report beside its eo.json says."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ...base.received.nesting import read_object
from .inputs import Inputs


def processed_with(inputs: Inputs) -> Mapping[str, Any] | None:
    """Return the flight file as it was resolved.

    Parameters
    ----------
    inputs : Inputs
        The block.

    Returns
    -------
    mapping or None
        Its tables; None where no report says them.
    """
    if inputs.file.aerial_control.positions_alone:
        return None
    beside = Path(inputs.file.aerial_control.file or ".").parent / "report.json"
    flight = read_object(beside).get("flight")
    return flight if isinstance(flight, dict) and "mounting" in flight else None
