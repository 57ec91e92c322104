"""What tuning found: in words, and as a document for machines."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from ...base.files import json_ready, picked
from ..estimation.gmwm import Fit
from ..moments.theory import haar_variance_parts
from .fits import Tuned, TuneData
from .products.page import static_document
from .recordings import AXES, StaticRecording

if TYPE_CHECKING:
    from ..estimation.selection import NearStationarity, Ranking


@dataclass(frozen=True, eq=False)
class TuneResult(TuneData):
    """The result of a tuning with its texts."""

    def summary(self) -> str:
        """Return the text for the terminal."""
        return static_document(self).text()

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


def _recording(r: StaticRecording) -> dict[str, Any]:
    out = asdict(r.source) | {"begin_s": r.begin_s, "length_s": r.length_s}
    return out | {
        "checks": [asdict(c) for c in r.checks],
        "disturbances": [asdict(d) for d in r.disturbances],
    }


def _fit(t: Tuned, recordings: Sequence[StaticRecording]) -> dict[str, Any]:
    return {
        "sensor": t.sensor,
        "axes": [AXES[k] for k in t.axes],
        "composition": str(t.kept.composition),
        "sampling": t.kept.sampling,
        "unit": "rad/s" if t.sensor == "gyro" else "m/s^2",
        "kept": "efficient" if t.efficient else "diagonal",
        "how": t.how,
        "diagonal_weights": _objective(t.first),
        "kept_weights": _objective(t.kept),
        "estimates": [
            picked(e, "name", "value", "standard_error", "low", "high", "at_bound")
            for e in t.inference.estimates
        ],
        "intervals": t.inference.intervals,
        "j_test": asdict(t.goodness),
        "verdicts": [asdict(v) for v in t.inference.verdicts],
        "ranking": None if t.ranking is None else _ranking(t.ranking),
        "near_stationarity": (
            None if t.stationarity is None else _stationarity(t.stationarity, recordings)
        ),
        "trends": [
            {"recording": name, "axis": AXES[k], **asdict(trend)} for name, k, trend in t.trends
        ],
        "remarks": list(t.remarks),
        "curves": _curves(t, recordings),
    }


def _objective(fit: Fit) -> dict[str, Any]:
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
                "axis": AXES[t.axes[i // len(recordings)]],
                **picked(curve, "rate_hz", "samples", "robust", "level", "scale_s", "low", "high"),
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
            **picked(c, *numbers),
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
    return picked(test, *numbers) | {
        "shares": {r.name: float(share) for r, share in zip(recordings, test.shares, strict=True)},
        "spread": [
            {"parameter": name, "found": scatter, "by_chance": chance}
            for name, scatter, chance in test.spread
        ],
        "sentence": test.sentence,
    }
