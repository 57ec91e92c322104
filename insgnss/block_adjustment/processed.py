"""What the flight of an orientation was processed with, as the report beside its eo.json says."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..base.errors import InputError
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

    Raises
    ------
    InputError
        The report is no JSON.
    """
    beside = Path(inputs.file.aerial_control.file or ".").parent / "report.json"
    try:
        report = json.loads(beside.read_text(encoding="utf-8"))
    except OSError:
        return None
    except (ValueError, RecursionError) as error:
        raise InputError.at_line(
            beside, None, f"is no JSON: {error}; process the flight again, or take the file away"
        ) from None
    flight = report.get("flight") if isinstance(report, dict) else None
    return flight if isinstance(flight, dict) and "mounting" in flight else None
