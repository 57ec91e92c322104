"""The files of a tuning: noise model, table, page. They appear together or not at all."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from ....base.errors import DataError
from ....navigation.noise_model.model import (
    NOISE_UNITS,
    AxisNoise,
    NoiseModel,
    model_of_text,
    text_of_model,
)
from ..recordings import SENSOR_AXES, SENSORS, StaticRecording
from ..result import Tuned, TuneResult
from ..targets import beside, write_tuning
from ..usable import envelope, rounded_axis
from .words import FITS_P, goodness_p, misfit, verdict

TUNED_MODEL = Path("imu_noise.toml")
WORST_OF_SIX = FITS_P / 6.0  # p-value below which a misfit goes into the file: one by chance


def noise_model(
    name: str,
    recordings: Sequence[StaticRecording],
    tuned: Sequence[Tuned],
    turn_on: Mapping[str, float],
) -> NoiseModel | None:
    """Noise of all six axes; None where one was not tuned."""
    axes: dict[tuple[str, int], AxisNoise] = {}
    for t in tuned:
        noise = rounded_axis(
            replace(t.noise, turn_on_bias=turn_on.get(t.sensor, 0.0)), NOISE_UNITS[t.sensor]
        )
        axes |= {(t.sensor, k): noise for k in t.axes}
    if len(axes) < 6:
        return None
    triads = {sensor: (axes[sensor, 0], axes[sensor, 1], axes[sensor, 2]) for sensor in SENSORS}
    models = {
        sensor: ", ".join(
            dict.fromkeys(str(t.kept.composition) for t in tuned if t.sensor == sensor)
        )
        for sensor in SENSORS
    }
    source = f"insgnss tune: gyro {models['gyro']}; accel {models['accel']}"
    return NoiseModel(
        name,
        source,
        triads["gyro"],
        triads["accel"],
        tuple(r.source for r in recordings),
        tuple(
            f"{t.name}: {next(misfit(t, recordings))}"
            for t in tuned
            if goodness_p(t) < WORST_OF_SIX
        ),
    )


def write(result: TuneResult, target: Path, measured: Sequence[Path]) -> TuneResult:
    """Write all files, made from the recordings `measured`; the result that names them."""
    from .charts import sensor_chart

    table, page = beside(target)
    if result.model is None:
        notes = (*result.notes, _why_no_model(result.tuned, table))
        result = replace(result, files=(table, page), notes=notes)
    else:
        result = replace(result, files=(target, table, page))
        _read_back(result, target)
    charts = [chart for s in SENSORS if (chart := sensor_chart(result, s)) is not None]
    document, numbers = result.document(charts), result.as_dict()
    write_tuning(target, result.model, _remarks(result), measured, document, numbers)
    return result


def _why_no_model(tuned: Sequence[Tuned], table: Path) -> str:
    """Say which axes are missing of a noise model, and where those are that were tuned."""
    tuned_axes = {(t.sensor, k) for t in tuned for k in t.axes}
    lacking = {s: [SENSOR_AXES[k] for k in range(3) if (s, k) not in tuned_axes] for s in SENSORS}
    names = ", ".join(f"{sensor} {' '.join(axes)}" for sensor, axes in lacking.items() if axes)
    return (
        f"no noise model was written: one of a flight has all six axes, and {names} were not tuned;"
        f" {table.name} has what was: tune the others with them, or enter them by hand"
    )


def _read_back(result: TuneResult, target: Path) -> None:
    """DataError where the file, read back, would fall short of what was fitted at some scale."""
    assert result.model is not None
    back = model_of_text(target, text_of_model(result.model, _remarks(result)))
    for t in result.tuned:
        for k in t.axes:
            try:
                envelope(getattr(back, t.sensor)[k], t.kept)
            except DataError as error:
                raise DataError(f"{target}: {t.sensor} {SENSOR_AXES[k]}: {error}") from None


def _remarks(result: TuneResult) -> tuple[str, ...]:
    """What a person who opens the noise model should know."""
    return (
        *result.turn_on,
        *(f"{t.name}: {text}" for t in result.tuned for text in verdict(t, result.recordings)),
    )
