"""What a flight says of its noise: in words, and as a document for machines."""

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ....base.files import json_ready, picked
from .data import FlightTuningData
from .words import flight_document

if TYPE_CHECKING:
    from ....navigation.innovations.innovation_noise import Innovations
    from .straight_flight import StraightFlight


@dataclass(frozen=True)
class FlightTuning(FlightTuningData):
    """What a flight says of its noise, with its texts."""

    def summary(self) -> str:
        """Return the text for the terminal."""
        return flight_document(self).text()

    def as_dict(self) -> dict[str, Any]:
        """Return a JSON-able document."""
        n, s = self.noise, self.straight
        factors = {
            name: {
                "factor": float(f),
                "standard_error": float(f * e) if e else None,
                "held": name in dict(n.held),
            }
            for name, f, e in zip(n.names, n.factor, n.log_sigma, strict=True)
        }
        four = picked(n, "before", "after", "at_best", "static_at_best")
        document = {
            "name": self.name,
            "verdict": "accept" if self.accepted else "keep",
            "reasons": list(self.reasons),
            "files": [str(file) for file in self.files],
            "factors": factors,
            "held": dict(n.held),
            "correlation": np.round(n.correlation, 4),
            "likelihood_gain": n.gain,
            "chance": n.chance,
            "duration_s": n.duration_s,
            "innovations": {key: _innovations(one) for key, one in four.items()},
            "fixes_lost": {"static": self.lost_before, "in_flight": self.lost_after},
            "straight_flight": None if s is None else _spectrum(s),
            "notes": self.notes,
        }
        return dict(json_ready(document))


def _innovations(innovations: "Innovations") -> dict[str, Any]:
    """Return the figures of the innovations; the document calls the rejected fixes "lost"."""
    return {
        "lost" if key == "rejected" else key: value for key, value in asdict(innovations).items()
    }


def _spectrum(straight: "StraightFlight") -> dict[str, Any]:
    """Return all of the spectrum but the curves."""
    keys: tuple[str, ...] = (
        "rate_hz",
        "duration_s",
        "windows",
        "mean_with_lines",
        "mean_without_lines",
    )
    keys += ("upper_limit", "level", "level_from_hz")
    return picked(straight, *keys) | {"lines": [asdict(line) for line in straight.lines]}
