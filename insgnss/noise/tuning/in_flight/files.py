"""What tuning on a flight leaves behind: the noise model where it is accepted, and the evidence, a
table for machines, a page and a spectrum.
"""

import hashlib
from dataclasses import replace
from pathlib import Path

from ....base.inputs import sha256
from ....base.units import round_in_unit
from ....flight.config.flight_file import Flight
from ....flight.processing.input_files import input_files, measurements
from ....flight.processing.recording import Recording
from ....navigation.innovations.innovation_noise import InFlightNoise
from ....navigation.noise_model.model import (
    NOISE_UNITS,
    AxisNoise,
    NoiseModel,
    RecordingSource,
)
from ....navigation.prepare.gaps import nominal_interval
from ....records import ImuSamples
from .. import targets
from ..targets import beside, write_tuning
from .result import FlightTuning

IN_FLIGHT_MODEL = "in_flight_noise.toml"


def plan_model_file(flight: Flight, out: Path | None, force: bool) -> Path:
    """Return the path of the noise model; UsageError as `targets.plan_model_file` raises it."""
    target = flight.path.parent / IN_FLIGHT_MODEL if out is None else Path(out)
    inputs = (flight.path, *input_files(flight))
    return targets.planned(target, force, measurements(flight), inputs)


def write(tuning: FlightTuning, flight: Flight, target: Path) -> FlightTuning:
    """Write the files, all or none, the noise model only where it is accepted.

    Parameters
    ----------
    tuning : FlightTuning
        The estimate.
    flight : Flight
        The flight it is of.
    target : Path
        The noise model.

    Returns
    -------
    FlightTuning
        The result, with the files named.
    """
    from .spectrum import spectra

    model = tuning.model if tuning.accepted else None
    tuning = replace(tuning, files=(*([target] if model else []), *beside(target)))
    document, numbers = tuning.document(spectra(tuning)), tuning.as_dict()
    write_tuning(target, model, tuning.reasons, input_files(flight), document, numbers)
    return tuning


def model_in_flight(flight: Flight, recording: Recording, noise: InFlightNoise) -> NoiseModel:
    """Return the static model with the factors estimated, and their provenance."""
    from .words import TUNED

    f, static = noise.imu_factors(), recording.noise
    factors = ", ".join(
        f"{TUNED[name]} x {f[name]:.3f} +- {noise.sigma(name):.3f}"
        for name in f
        if noise.sigma(name) > 0.0
    )
    source = (
        f"{static.source}; by the innovations of flight {flight.name} {factors or 'nothing else'}"
    )
    rate = round(1.0 / nominal_interval(recording.imu.time), 3)
    name, digest = _identity(flight.imu.file)
    imu = RecordingSource(name, digest, recording.imu.time.size, rate)
    gx, gy, gz = (_scale_axis(axis, "gyro", noise) for axis in static.gyro)
    ax, ay, az = (_scale_axis(axis, "accel", noise) for axis in static.accel)
    return NoiseModel(
        f"{static.name} in flight",
        source,
        (gx, gy, gz),
        (ax, ay, az),
        (*static.recordings, imu),
        static.misfit,
    )


def _identity(samples: Path | ImuSamples) -> tuple[str, str]:
    """Name and hash of a file of samples, or of samples that were given as an object."""
    if isinstance(samples, Path):
        return samples.name, sha256(samples)
    digest = hashlib.sha256()
    for field in (samples.time, samples.gyro, samples.accel):
        digest.update(field.tobytes())
    return samples.source or "given as object", digest.hexdigest()


def _scale_axis(axis: AxisNoise, sensor: str, noise: InFlightNoise) -> AxisNoise:
    """Return one axis with its triad's factors.

    Standard errors of what was estimated replace those of the static model.
    """
    factors, error = noise.imu_factors(), dict(axis.standard_error)

    def times(value: float, name: str, quantity: str, number: str = "") -> float:
        unit = NOISE_UNITS[sensor][quantity]
        if value and noise.sigma(name) > 0.0:
            error[quantity + number] = round_in_unit(value * noise.sigma(name), unit, 2)
        return round_in_unit(value * factors[name], unit, 6) if factors[name] != 1.0 else value

    for name in factors.keys() & {f"{sensor}.white_noise", "white_noise"}:
        axis = replace(axis, white_noise=times(axis.white_noise, name, "white_noise"))
    if (name := f"{sensor}.driving_noise") in factors:
        processes = tuple(
            replace(gm, driving_noise=times(gm.driving_noise, name, "driving_noise", f"_{k}"))
            for k, gm in enumerate(axis.gauss_markov, start=1)
        )
        axis = replace(
            axis, random_walk=times(axis.random_walk, name, "random_walk"), gauss_markov=processes
        )
    return replace(axis, standard_error=tuple(error.items()))
