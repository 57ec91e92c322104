"""What a flight says of its noise: in words, and as a document for machines."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ....base.files import json_ready, pick_attributes
from ....navigation.innovations.innovation_noise import InFlightNoise, WhitenedInnovations
from ....navigation.noise_model.model import NoiseModel
from ....report.charts.chart import Chart
from ....report.document import Document, Section, Table
from ....report.notebook import Documented
from ....report.verdict import worst_of
from .straight_flight import StraightFlight
from .words import TUNED, remarks_on, spectrum_parts, white_noise_of, whiteness_rows


@dataclass(frozen=True)
class FlightTuning(Documented):
    """What a flight says of its noise. accepted : whether the static model gives way.
    reasons : of that, sentence by sentence.

    noise : the estimate.   static, model : the model of the flight file, and the same with the
                            factors found.
    files : what was written.
    lost_before, lost_after : fixes that the solutions with the static model and with the new one
        reject.
    straight : spectrum of the IMU in straight flight, None without.
    dropped_correlated : whether noise of the IMU explains what the
    solution took for a time-correlated error of the fixes.
    notes : what became of segments between gaps of the IMU.
    key : of the flight
    file, for the model found.
    """

    name: str
    accepted: bool
    reasons: tuple[str, ...]
    noise: InFlightNoise
    static: NoiseModel
    model: NoiseModel
    lost_before: int
    lost_after: int
    straight: StraightFlight | None
    dropped_correlated: bool
    notes: tuple[str, ...] = ()
    files: tuple[Path, ...] = ()
    key: str = "imu.noise"

    @property
    def headline(self) -> str:
        """The verdict without its reasons."""
        return (
            "accept the noise found in flight"
            if self.accepted
            else f"keep the static model {self.static.name}"
        )

    @property
    def verdict(self) -> str:
        """In one sentence."""
        return f"{self.headline}: {'; '.join(self.reasons)}"

    @property
    def file(self) -> Path | None:
        """The noise model that was written, or None."""
        return self.files[0] if self.accepted and self.files else None

    def document(self, charts: Sequence[Chart] = ()) -> Document:
        """Return what a tuning on a flight says.

        Parameters
        ----------
        charts : sequence of Chart
            Spectra of straight flight, for the page.
        """
        n = self.noise
        factors = list(zip(n.names, n.factor, n.log_sigma, strict=True))
        largest = ", ".join(
            f"{TUNED[name]} x {f:.3f} +- {f * sigma:.3f}"
            for name, f, sigma in factors
            if sigma > 0.0
        )
        rows = [
            (
                TUNED[name],
                f"{f:.3f}",
                f"{f * sigma:.3f}" if sigma else "held",
                white_noise_of((self.static, self.model), name),
            )
            for name, f, sigma in factors
        ]
        remarks = remarks_on(n)
        if self.dropped_correlated:
            remarks.append(
                "noise of the IMU explains what the solution took for a time-correlated error of"
                " the fixes"
            )
        spectrum = spectrum_parts(self.straight, self.static, self.model, n)
        reasons = "; ".join(self.reasons)
        innovations = Table(
            whiteness_rows(n.before, n.after),
            ("innovations of the positions", "before", "after"),
            numbers=True,
        )
        use = "" if self.file is None else f'{self.key} = "{self.file.name}" in the flight file'
        return Document(
            f"{self.name}: noise of the IMU in flight",
            f"{self.headline}: {largest or 'nothing was determined'}, from"
            f" {n.duration_s / 60.0:.1f} min in motion",
            worst_of(reasons, [] if self.accepted else [reasons]),
            (
                *charts,
                Section(
                    "Factors on the static model",
                    [Table(rows, ("", "factor", "standard error", "white noise")), *remarks],
                ),
                Section("Held", [f"{TUNED[name]}: {why}" for name, why in n.held]),
                Section("Innovations", [innovations]),
                Section("Spectrum", tuple(spectrum)),
                Section("Notes", self.notes),
            ),
            hashes={r.file: r.sha256 for r in self.model.recordings},
            settings={"static model": self.static.name, "key of the flight file": self.key},
            files=self.files,
            next=f"to use it: {use} (a path relative to the flight file)" if use else "",
        )

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
        four = pick_attributes(n, "before", "after", "at_best", "static_at_best")
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


def _innovations(innovations: WhitenedInnovations) -> dict[str, Any]:
    """Return the figures of the innovations; the document calls the rejected fixes "lost"."""
    return {
        "lost" if key == "rejected" else key: value for key, value in asdict(innovations).items()
    }


def _spectrum(straight: StraightFlight) -> dict[str, Any]:
    """Return all of the spectrum but the curves."""
    keys: tuple[str, ...] = ("rate_hz", "duration_s", "windows", "mean_with_lines")
    keys += ("mean_without_lines", "upper_limit", "level", "level_from_hz")
    return pick_attributes(straight, *keys) | {"lines": [asdict(line) for line in straight.lines]}
