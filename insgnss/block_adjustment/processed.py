"""What the flight of an orientation was processed with, as the report beside its eo.json says."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

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
    beside = Path(inputs.file.aerial_control.file or ".").parent / "report.json"
    try:
        flight = json.loads(beside.read_text(encoding="utf-8"))["flight"]
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None
    return flight if isinstance(flight, dict) and "mounting" in flight else None
