"""The outcome of a multi-position calibration: parameters, standard errors, observability.

A parameter is observed where its standard error is below a third of what is usual of such sensors
(`USUAL_SIZES`), weakly observed below the whole. What is not observed on its own may be known in
combination with others: eigenvectors of the covariance, each parameter in units of its usual size,
name the combinations that are not.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...base.files import pick_attributes
from ...base.units import STANDARD_GRAVITY
from ...navigation.prepare.calibration import ImuCalibration, TriadCalibration
from ...navigation.prepare.stationarity import StationaryPeriods
from ...records import Array
from ...records.states import State
from ...records.verdicts import Estimate
from ...report.document import Document, Section, Table
from ...report.notebook import Shown
from ...report.verdict import worst_of

# by unit, of biases, scale factors and misalignments: 40 deg/h, 1 mg, 1000 ppm, 1 mrad
USUAL_SIZES = {"rad/s": 2e-4, "m/s^2": 0.01, "": 1e-3, "rad": 1e-3}
POSSIBLE = {"rad/s": 0.35, "m/s^2": 5.0, "": 0.1, "rad": 0.1}  # limits of a calibration file
SHOWN_UNITS = {
    "rad/s": (float(np.degrees(3600.0)), "deg/h"),
    "m/s^2": (1e3 / STANDARD_GRAVITY, "mg"),
    "": (1e6, "ppm"),
    "rad": (1e3, "mrad"),
}
NAMED_COMPONENT = 0.3  # least component of a blind direction that is named


@dataclass(frozen=True)
class Parameter(Estimate):
    """One parameter of the calibration, whose `prior` is what is usual of such sensors.

    Parameters
    ----------
    sensor : str
        "gyro" or "accel"; the others are those of `Estimate`: a bias in rad/s or m/s^2, a scale
        factor in 1, a misalignment in rad.
    """

    sensor: str = ""

    @property
    def verdict(self) -> str:
        """How well it is observed."""
        return self.degree("observed", "weakly observed", "not observed")

    @property
    def shown(self) -> tuple[float, float, str]:
        """The value and the standard error in the unit that stands third."""
        factor, unit = SHOWN_UNITS[self.state.unit]
        return factor * self.value, factor * self.sigma, unit

    def as_dict(self) -> dict[str, Any]:
        """Return it for machines."""
        return {key: getattr(self, key) for key in ("sensor", "name", "value", "sigma", "verdict")}


@dataclass(frozen=True, eq=False)
class TriadEstimate:
    """Estimate of one triad.

    Parameters
    ----------
    sensor : str
        "gyro" or "accel".
    states : tuple of State
        The p parameters.
    values : ndarray, (p,)
        Values, SI.
    covariance : ndarray, (p, p)
        Their covariance.
    residual : ndarray, (r,)
        Normalised residuals.
    variance_factor : dict of str to float
        Variance factor of each group, before it was used.
    blind : tuple of str
        Directions without information, in words.
    """

    sensor: str
    states: tuple[State, ...]
    values: Array
    covariance: Array
    residual: Array
    variance_factor: dict[str, float]
    blind: tuple[str, ...]

    @property
    def sigma(self) -> Array:
        """The standard errors (p,), SI."""
        return np.asarray(np.sqrt(np.diag(self.covariance)), dtype=np.float64)

    @property
    def correlation(self) -> Array:
        """The correlations (p, p)."""
        return self.covariance / np.outer(self.sigma, self.sigma)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The parameters, with a verdict on each."""
        usual = sizes(USUAL_SIZES, self.states)
        columns = zip(self.states, self.values.tolist(), self.sigma.tolist(), usual, strict=True)
        return tuple(Parameter(*of_one, sensor=self.sensor) for of_one in columns)

    def triad(self) -> TriadCalibration:
        """Return the estimate for the calibration file."""
        response, sigma = np.eye(3), np.zeros((3, 3))
        for entry, value, error in zip(
            places(self.states), self.values[3:], self.sigma[3:], strict=True
        ):
            response[entry] += value
            sigma[entry] = error
        return TriadCalibration(self.values[:3].copy(), response, self.sigma[:3], sigma)


@dataclass(frozen=True, eq=False)
class MultiPosition(Shown):
    """Calibration from a multi-position recording, and how good it is.

    Parameters
    ----------
    accel, gyro : TriadEstimate
        Estimates of the triads.
    stationary : StationaryPeriods
        The stationary periods.
    positions, turns : int
        Number of distinct positions, and of turns between them.
    gravity, gravity_sigma : float
        Gravity used for the scale and its standard deviation, m/s^2.
    source : str
        Name of the recording.
    """

    accel: TriadEstimate
    gyro: TriadEstimate
    stationary: StationaryPeriods
    positions: int
    turns: int
    gravity: float
    gravity_sigma: float
    source: str

    @property
    def calibration(self) -> ImuCalibration:
        """The calibration, to be written with
        `navigation.prepare.calibration.write_calibration`.
        """
        description = (
            f"multi-position, {len(self.stationary)} stationary periods in {self.positions}"
            f" positions, gravity {self.gravity:.5f} m/s^2"
        )
        return ImuCalibration(
            self.gyro.triad(), self.accel.triad(), Path(self.source).stem, description
        )

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The parameters of both triads."""
        return (*self.accel.parameters, *self.gyro.parameters)

    def summary(self) -> str:
        """Return the text for the terminal."""
        rows, fits = [], []
        named: dict[str, list[str]] = {}
        for parameter in self.parameters:
            value, sigma, unit = parameter.shown
            name = f"{parameter.sensor} {parameter.name}"
            cells = (parameter.sensor, parameter.name, f"{value:.3f} ± {sigma:.3f}", unit)
            rows.append((*cells, parameter.verdict))
            named.setdefault(parameter.verdict, []).append(name)
        for triad in (self.accel, self.gyro):
            worst = float(np.abs(triad.residual).max())
            fits += [
                f"{triad.sensor}: {group} residuals {np.sqrt(factor):.2f} times the white noise,"
                f" largest {worst:.1f} sigma"
                for group, factor in triad.variance_factor.items()
            ]
            fits += [f"{triad.sensor}: not observed: {direction}" for direction in triad.blind]
        ppm = 1e6 * self.gravity_sigma / self.gravity
        gravity = (
            f"gravity {self.gravity:.5f} m/s^2, standard deviation {self.gravity_sigma:.5f}"
            f" ({ppm:.0f} ppm of every scale factor of the accelerometers)"
        )
        named.pop("observed", None)
        return Document(
            self.source,
            f"{self.source}: {len(self.stationary)} stationary periods in {self.positions}"
            f" positions, {self.turns} turns between them",
            worst_of(
                "every parameter is observed", [f"{k}: {', '.join(v)}" for k, v in named.items()]
            ),
            (Section("Parameters", [Table(rows)]), Section("Residuals", [gravity, *fits])),
        ).text()

    def as_dict(self) -> dict[str, Any]:
        """Return a JSON-able document: parameters in SI, covariances, residual statistics."""
        document: dict[str, Any] = {
            "stretches": len(self.stationary),
            **pick_attributes(self, "source", "positions", "turns", "gravity", "gravity_sigma"),
        }
        for estimate in (self.accel, self.gyro):
            document[estimate.sensor] = {
                "parameters": [parameter.as_dict() for parameter in estimate.parameters],
                "correlation": estimate.correlation.tolist(),
                "variance_factor": estimate.variance_factor,
                "largest_residual_sigma": float(np.abs(estimate.residual).max()),
                "not_observed": list(estimate.blind),
            }
        return document


def sizes(table: Mapping[str, float], states: Sequence[State]) -> Array:
    """Return the sizes (p,) of `USUAL_SIZES` or `POSSIBLE`, in rad/s, m/s^2, 1 or rad."""
    return np.array([table[state.unit] for state in states])


def places(states: Sequence[State]) -> list[tuple[int, int]]:
    """Return the entries (row, column) of E of the parameters after the bias."""
    return [("xyz".index(one.axis[0]), "xyz".index(one.axis[-1])) for one in states[3:]]


def blind_directions(states: Sequence[State], covariance: Array) -> tuple[str, ...]:
    """Name the combinations of parameters that are not observed.

    Parameters
    ----------
    states : sequence of State
        The p parameters.
    covariance : ndarray, (p, p)
        Their covariance, SI.

    Returns
    -------
    tuple of str
        Combinations in words, each with its standard error in units of the usual.
    """
    usual_sizes = sizes(USUAL_SIZES, states)
    values, vectors = np.linalg.eigh(covariance / np.outer(usual_sizes, usual_sizes))
    out = []
    for value, vector in zip(values[::-1], vectors.T[::-1], strict=True):
        if value < 1.0:
            break
        # of equal parts the first leads, whatever their last digits
        components = np.round(np.abs(vector), 6)
        vector = vector * np.sign(vector[np.argmax(components)])
        terms = [
            f"{'+' if vector[i] > 0 else '-'} {states[i]}"
            for i in np.argsort(-components, kind="stable")
            if abs(vector[i]) > NAMED_COMPONENT
        ]
        out.append(f"{' '.join(terms).removeprefix('+ ')} ({np.sqrt(value):.1f} times the usual)")
    return tuple(out)
