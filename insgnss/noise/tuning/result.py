"""What tuning found: in words, and as a document for machines."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...base.files import json_ready, pick_attributes
from ...navigation.noise_model.model import NoiseModel
from ...report.charts.chart import Chart
from ...report.document import Document, Section, Table, checks_section
from ...report.notebook import Documented
from ...report.verdict import Verdict, worst_of
from ..estimation.gmwm import NoiseFit
from ..estimation.goodness import p_text
from ..moments.theory import haar_variance_parts
from .fits import Tuned
from .options import TuneOptions
from .products.table import duration, interval, symbol, unit_text, value_text
from .products.words import FITS_P, goodness_p, sensor_words, sentences, trends
from .recordings import SENSOR_AXES, SENSORS, StaticRecording

if TYPE_CHECKING:
    from ..estimation.near_stationarity import NearStationarity
    from ..estimation.selection import Ranking


@dataclass(frozen=True, eq=False)
class TuneResult(Documented):
    """All fits, the recordings they rest on, and the noise model, None where a sensor is missing;
    `files` that were written.
    """

    recordings: tuple[StaticRecording, ...]
    tuned: tuple[Tuned, ...]
    model: NoiseModel | None
    turn_on: tuple[str, ...]
    options: TuneOptions
    files: tuple[Path, ...] = ()
    notes: tuple[str, ...] = field(default_factory=tuple)

    def document(self, charts: Sequence[Chart] = ()) -> Document:
        """Return what a tuning says.

        Parameters
        ----------
        charts : sequence of Chart
            A chart a sensor, for the page.
        """
        recordings, usual = self.recordings, asdict(TuneOptions())
        by_sensor = {s: [t for t in self.tuned if t.sensor == s] for s in SENSORS}
        by_sensor = {sensor: tuned for sensor, tuned in by_sensor.items() if tuned}
        remarks = [f"{t.name}: {text}" for t in self.tuned for text in sentences(t, recordings)]
        verdicts = [sensor_words(tuned, recordings, self.options) for tuned in by_sensor.values()]
        for sensor, tuned in by_sensor.items():
            remarks += trends(sensor, tuned, recordings)
        notes_on_checks = [
            f"{r.name}: {c.name}: {c.found}" + (f"; {c.advice}" if c.advice else "")
            for r in recordings
            for c in r.checks
            if c.verdict != "ok"
        ]
        head = ("axes", "parameter", "estimate", "unit", "95 % interval", "J test")
        rows = [row for t in self.tuned for row in _rows(t)]
        lengths = [
            f"{r.name}: {r.source.samples} samples at {r.source.sampling_rate_hz:g} Hz,"
            f" {duration(r.length_s)}"
            for r in recordings
        ]
        return Document(
            f"{self.files[0].stem if self.files else 'noise'}: noise of an IMU at rest",
            "; ".join(f"{model} ({of})" for model, of in verdicts),
            self._verdict(),
            (
                *charts,
                Section("Parameters, each with its standard error", [Table(rows, head)]),
                Section(
                    "Remarks",
                    [*notes_on_checks, *remarks, *self.turn_on, *self.notes],
                ),
                Section("Recordings", lengths),
                checks_section((check for r in recordings for check in r.checks), on="page"),
            ),
            hashes={r.source.file: r.source.sha256 for r in recordings},
            settings={k: value for k, value in asdict(self.options).items() if value != usual[k]},
            files=self.files,
        )

    def _verdict(self) -> Verdict:
        """Return how far the models explain the recordings."""
        tested = [t for t in self.tuned if math.isfinite(goodness_p(t))]
        good = f"the J test contradicts none of {len(tested)} models"
        if not tested:
            good = "every axis has a model; none has so many scales that it could be tested"
        doubtful = []
        if misfits := [t.name for t in tested if goodness_p(t) < FITS_P]:
            doubtful.append(
                f"the J test contradicts {len(misfits)} of {len(tested)} models"
                f" ({', '.join(misfits)}; by chance one in {1.0 / FITS_P:.0f} does); the size of"
                " each misfit is listed below"
            )
        if self.model is None:
            doubtful.append("no noise model was written: a sensor or an axis is missing")
        return worst_of(good, doubtful)

    def as_dict(self) -> dict[str, Any]:
        """JSON-able."""
        document = {
            "recordings": [_recording(r) for r in self.recordings],
            "options": asdict(self.options),
            "fits": [_fit(t, self.recordings) for t in self.tuned],
            "turn_on_bias": list(self.turn_on),
            "notes": list(self.notes),
            "files": self.files,
        }
        return dict(json_ready(document))


def _rows(t: Tuned) -> Iterator[tuple[str, ...]]:
    """Yield the parameters of one model."""
    p = goodness_p(t)
    test = p_text(p) if math.isfinite(p) else "no test"
    for e in t.inference.estimates:
        name = f"{symbol(e.term)} {e.term.kind.replace('_', ' ')}"
        estimate = value_text(t.sensor, e)
        unit = unit_text(t.sensor, e.term.kind)
        yield (t.name, name, estimate, unit, interval(t.sensor, e), test)


def _recording(r: StaticRecording) -> dict[str, Any]:
    out = asdict(r.source) | {"begin_s": r.begin_s, "length_s": r.length_s}
    return out | {
        "checks": [c.as_dict() for c in r.checks],
        "disturbances": [asdict(d) for d in r.disturbances],
    }


def _fit(t: Tuned, recordings: Sequence[StaticRecording]) -> dict[str, Any]:
    return {
        "sensor": t.sensor,
        "axes": [SENSOR_AXES[k] for k in t.axes],
        "composition": str(t.kept.composition),
        "sampling": t.kept.sampling,
        "unit": "rad/s" if t.sensor == "gyro" else "m/s^2",
        "kept": "efficient" if t.efficient else "diagonal",
        "how": t.how,
        "diagonal_weights": _objective(t.first),
        "kept_weights": _objective(t.kept),
        "estimates": [
            pick_attributes(e, "name", "value", "standard_error", "low", "high", "at_bound")
            for e in t.inference.estimates
        ],
        "intervals": t.inference.intervals,
        "j_test": asdict(t.goodness),
        "verdicts": [asdict(v) for v in t.inference.verdicts],
        "ranking": t.ranking and _ranking(t.ranking),
        "near_stationarity": t.stationarity and _stationarity(t.stationarity, recordings),
        "trends": [
            {"recording": name, "axis": SENSOR_AXES[k], **asdict(trend)}
            for name, k, trend in t.trends
        ],
        "remarks": list(t.remarks),
        "curves": _curves(t, recordings),
    }


def _objective(fit: NoiseFit) -> dict[str, Any]:
    return {
        "objective": fit.objective,
        "parameters": dict(zip(fit.composition.parameters, fit.parameters.tolist(), strict=True)),
    }


def _curves(t: Tuned, recordings: Sequence[StaticRecording]) -> list[dict[str, Any]]:
    """Wavelet variances with what the model says of them."""
    out = []
    for i, (curve, modelled) in enumerate(zip(t.kept.curves, t.kept.modelled, strict=True)):
        parts = haar_variance_parts(t.kept.axis, curve.level, curve.rate_hz, t.kept.sampling)
        out.append(
            {
                "recording": recordings[i % len(recordings)].name,
                "axis": SENSOR_AXES[t.axes[i // len(recordings)]],
                **pick_attributes(
                    curve, "rate_hz", "samples", "robust", "level", "scale_s", "low", "high"
                ),
                "wavelet_variance": curve.variance,
                "modelled": modelled,
                "parts": parts,
                "residual_sigma": t.inference.goodness.residuals[i],
            }
        )
    return out


def _ranking(ranking: "Ranking") -> dict[str, Any]:
    """The models that competed, best first."""
    numbers = ("wic", "difference", "p_value", "cross_validated", "equivalent", "remarks")
    models = [
        {
            "composition": str(c.composition),
            "parameters": c.composition.size,
            "objective": c.fit.objective,
            **pick_attributes(c, *numbers),
        }
        for c in ranking.candidates
    ]
    return {
        "criterion": ranking.criterion,
        "chosen": str(ranking.chosen.composition),
        "models": models,
    }


def _stationarity(
    test: "NearStationarity", recordings: Sequence[StaticRecording]
) -> dict[str, Any]:
    """Whether one parameter set serves all recordings."""
    numbers = ("statistic", "degrees", "p_value", "bootstrapped", "bootstrapped_error", "draws")
    return pick_attributes(test, *numbers) | {
        "shares": {r.name: float(share) for r, share in zip(recordings, test.shares, strict=True)},
        "spread": [
            {"parameter": name, "found": scatter, "by_chance": chance}
            for name, scatter, chance in test.spread
        ],
        "sentence": test.sentence,
    }
