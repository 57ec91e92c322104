"""The noise model of an IMU, and its file.

Each axis is a sum of named processes, for a gyroscope in X = rad/s and for an accelerometer in X =
m/s^2:

    turn_on_bias    X              standard deviation of a constant
    white_noise     X/sqrt(Hz)     root power spectral density (angle or velocity random walk, X
                                   sqrt(s))
    quantization    X s            standard deviation of white rounding error on the cumulated angle
                                   or velocity (step / sqrt(12))
    random_walk     X/s/sqrt(Hz)   root power spectral density of the driving white noise
    drift           X/s            standard deviation of a constant slope
    gauss_markov    de/dt = -e/T + xi, root power spectral density of xi in X/s/sqrt(Hz)
    scale_factor    1              standard deviation; used where the filter estimates it
    misalignment    rad            the same

White noise of root density q integrates to a variance of q^2 dt over dt (footnote 7 of paper 000).
The file is TOML as in `data_specs` (noise model); [gyro.x] overrides single quantities of [gyro]
for that axis. A model that was estimated says of which recordings, and how well each quantity is
known.
"""

import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ...base.errors import InputError
from ...base.files import atomic_write
from ...base.inputs import read_text
from .noise_file import model_of_text, text_of_model
from .noise_model import (
    GAUSS_MARKOV,
    GM_KEYS,
    NOISE_UNITS,
    QUANTITIES,
    AxisNoise,
    GaussMarkov,
    NoiseModel,
    RecordingSource,
)

__all__ = [
    "GAUSS_MARKOV",
    "GM_KEYS",
    "NOISE_UNITS",
    "QUANTITIES",
    "AxisNoise",
    "GaussMarkov",
    "NoiseModel",
    "RecordingSource",
    "load_noise_model",
    "shipped_models",
    "weighted_model",
    "write_noise_model",
]

MODELS = Path(__file__).parent / "models"


def shipped_models() -> tuple[str, ...]:
    """Names of the noise models that the package brings along."""
    return tuple(sorted(path.stem for path in MODELS.glob("*.toml")))


def weighted_model(
    models: Sequence[NoiseModel], weights: Sequence[tuple[float, float]]
) -> NoiseModel:
    """Noise of the weighted mean of several IMUs, whose errors are independent.

    weights : share of each in gyro and accelerometer. Every density and sigma q_j becomes sqrt(sum
        (weight q_j)^2); Gauss-Markov processes
    are added up where all models have the same correlation times, and stand side by side where not.
    """

    def triad(sensor: str, k: int) -> tuple[AxisNoise, AxisNoise, AxisNoise]:
        share = [weight[k] for weight in weights]
        x, y, z = (
            _weighted_axis([getattr(model, sensor)[c] for model in models], share) for c in range(3)
        )
        return x, y, z

    name, source = (
        " + ".join(dict.fromkeys(getattr(model, f) for model in models)) for f in ("name", "source")
    )
    recordings = dict.fromkeys(recording for model in models for recording in model.recordings)
    misfit = dict.fromkeys(sentence for model in models for sentence in model.misfit)
    return NoiseModel(
        name, source, triad("gyro", 0), triad("accel", 1), tuple(recordings), tuple(misfit)
    )


def _weighted_axis(axes: list[AxisNoise], w: list[float]) -> AxisNoise:
    plain: dict[str, Any] = {
        name: math.hypot(*(w_j * getattr(axis, name) for axis, w_j in zip(axes, w, strict=True)))
        for name in QUANTITIES
    }
    times = [tuple(gm.correlation_time_s for gm in axis.gauss_markov) for axis in axes]
    scaled = [
        [
            GaussMarkov(gm.correlation_time_s, abs(w_j) * gm.driving_noise)
            for gm in axis.gauss_markov
        ]
        for axis, w_j in zip(axes, w, strict=True)
    ]
    if len(set(times)) == 1:
        processes = tuple(
            GaussMarkov(T, math.hypot(*(own[i].driving_noise for own in scaled)))
            for i, T in enumerate(times[0])
        )
    else:
        processes = tuple(gm for own in scaled for gm in own if gm.driving_noise > 0.0)
    return AxisNoise(gauss_markov=processes, **plain)


def load_noise_model(name_or_path: str | os.PathLike[str] | NoiseModel) -> NoiseModel:
    """Return the noise model of a shipped name, such as "navchip", or of a file.

    Parameters
    ----------
    name_or_path : name, path, or a model, which is returned as it is.

    Returns
    -------
    The model.

    Raises
    ------
    InputError : with file and line, for a file that is missing or no TOML, an unknown key or table
        (naming the nearest), and a quantity that is negative, without unit or of another dimension.
    """
    if isinstance(name_or_path, NoiseModel):
        return name_or_path
    shipped = shipped_models()
    name = os.fspath(name_or_path)
    path = MODELS / f"{name}.toml" if name in shipped else Path(name)
    try:
        text = read_text(path, "utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        why = (
            "not UTF-8 text"
            if isinstance(error, UnicodeDecodeError)
            else (error.strerror or str(error)).lower()
        )
        raise InputError(
            f"{name}: {why}; give a noise-model file or one of the shipped {', '.join(shipped)}"
        ) from None
    return model_of_text(path, text)


def write_noise_model(
    model: NoiseModel, path: str | os.PathLike[str], remarks: Sequence[str] = ()
) -> None:
    """Write a noise-model file, whole or not at all.

    `load_noise_model` turns it back into the same model.

    Parameters
    ----------
    model : NoiseModel
        The model.
    path : path-like
        The file.
    remarks : sequence of str
        Sentences that stand above it as comments.

    Raises
    ------
    UsageError
        Where the path cannot be written.
    """
    atomic_write(path, text_of_model(model, remarks))
