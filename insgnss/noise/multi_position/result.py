"""The outcome of a multi-position calibration: parameters, standard errors, observability.

A parameter is observed where its standard error is below a third of what is usual of such sensors
(`USUAL`), weakly observed below the whole. What is not observed on its own may be known in
combination with others: eigenvectors of the covariance, each parameter in units of its usual size,
name the combinations that are not.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...base.files import picked
from ...base.units import STANDARD_GRAVITY
from ...navigation.prepare.calibration import ImuCalibration, TriadCalibration
from ...navigation.prepare.stationarity import StationaryPeriods
from ...records import Array
from ...records.verdicts import OBSERVED
from ...report.document import Document, Section, Table
from ...report.verdict import worst_of

USUAL = {
    "bias gyro": 2e-4,
    "bias accel": 0.01,
    "scale_factor": 1e-3,
    "misalignment": 1e-3,
}  # rad/s, m/s^2, 1, rad; 40 deg/h, 1 mg
POSSIBLE = {
    "bias gyro": 0.35,
    "bias accel": 5.0,
    "scale_factor": 0.1,
    "misalignment": 0.1,
}  # the limits of a calibration file
NAMED = 0.3  # least component of a blind direction that is named


@dataclass(frozen=True)
class Parameter:
    """One parameter of the calibration.

    Parameters
    ----------
    sensor, name : str
        "gyro" or "accel", and the parameter's name.
    value, sigma : float
        Value and standard error: a bias in rad/s or m/s^2, a scale factor in 1, a misalignment in
        rad.
    verdict : str
        "observed", "weakly observed" or "not observed".
    """

    sensor: str
    name: str
    value: float
    sigma: float
    verdict: str

    @property
    def shown(self) -> tuple[float, float, str]:
        """The value and the standard error in the unit that stands third."""
        if self.name.startswith("bias"):
            factor, unit = (
                (np.degrees(3600.0), "deg/h")
                if self.sensor == "gyro"
                else (1e3 / STANDARD_GRAVITY, "mg")
            )
        else:
            factor, unit = (1e6, "ppm") if self.name.startswith("scale") else (1e3, "mrad")
        return float(factor * self.value), float(factor * self.sigma), unit


@dataclass(frozen=True, eq=False)
class TriadEstimate:
    """Estimate of one triad.

    Parameters
    ----------
    sensor : str
        "gyro" or "accel".
    names : tuple of str
        Names of the p parameters.
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
    names: tuple[str, ...]
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
        out = []
        for name, value, sigma, size in zip(
            self.names, self.values, self.sigma, sizes(USUAL, self.sensor, self.names), strict=True
        ):
            share = sigma / size
            verdict = (
                "observed"
                if share < OBSERVED
                else "weakly observed"
                if share < 1.0
                else "not observed"
            )
            out.append(Parameter(self.sensor, name, float(value), float(sigma), verdict))
        return tuple(out)

    def triad(self) -> TriadCalibration:
        """Return the estimate for the calibration file."""
        response, sigma = np.eye(3), np.zeros((3, 3))
        for entry, value, error in zip(
            places(self.names), self.values[3:], self.sigma[3:], strict=True
        ):
            response[entry] += value
            sigma[entry] = error
        return TriadCalibration(self.values[:3].copy(), response, self.sigma[:3], sigma)


@dataclass(frozen=True, eq=False)
class MultiPosition:
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
        for p in self.parameters:
            value, sigma, unit = p.shown
            rows.append((p.sensor, p.name, f"{value:.3f} ± {sigma:.3f}", unit, p.verdict))
            named.setdefault(p.verdict, []).append(f"{p.sensor} {p.name}")
        for e in (self.accel, self.gyro):
            worst = float(np.abs(e.residual).max())
            fits += [
                f"{e.sensor}: {group} residuals {np.sqrt(factor):.2f} times the white noise,"
                f" largest {worst:.1f} sigma"
                for group, factor in e.variance_factor.items()
            ]
            fits += [f"{e.sensor}: not observed: {words}" for words in e.blind]
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
            **picked(self, "source", "positions", "turns", "gravity", "gravity_sigma"),
        }
        for estimate in (self.accel, self.gyro):
            document[estimate.sensor] = {
                "parameters": [vars(parameter) for parameter in estimate.parameters],
                "correlation": estimate.correlation.tolist(),
                "variance_factor": estimate.variance_factor,
                "largest_residual_sigma": float(np.abs(estimate.residual).max()),
                "not_observed": list(estimate.blind),
            }
        return document


def sizes(table: Mapping[str, float], sensor: str, names: Sequence[str]) -> Array:
    """Return the sizes (p,) of `USUAL` or `POSSIBLE`, in rad/s, m/s^2, 1 or rad."""
    kinds = [name.split()[0] for name in names]
    return np.array([table[f"bias {sensor}" if kind == "bias" else kind] for kind in kinds])


def places(names: tuple[str, ...]) -> list[tuple[int, int]]:
    """Return the entries (row, column) of E of the parameters after the bias."""
    words = [name.split()[1] for name in names[3:]]
    return [("xyz".index(word[0]), "xyz".index(word[-1])) for word in words]


def blind_directions(sensor: str, names: tuple[str, ...], covariance: Array) -> tuple[str, ...]:
    """Name the combinations of parameters that are not observed.

    Parameters
    ----------
    sensor : str
        "gyro" or "accel".
    names : tuple of str
        Names of the p parameters.
    covariance : ndarray, (p, p)
        Their covariance, SI.

    Returns
    -------
    tuple of str
        Combinations in words, each with its standard error in units of the usual.
    """
    size = sizes(USUAL, sensor, names)
    values, vectors = np.linalg.eigh(covariance / np.outer(size, size))
    out = []
    for value, vector in zip(values[::-1], vectors.T[::-1], strict=True):
        if value < 1.0:
            break
        size_of = np.round(
            np.abs(vector), 6
        )  # of equal parts the first leads, whatever their last digits
        vector = vector * np.sign(vector[np.argmax(size_of)])
        parts = [
            f"{'+' if vector[i] > 0 else '-'} {names[i]}"
            for i in np.argsort(-size_of, kind="stable")
            if abs(vector[i]) > NAMED
        ]
        out.append(f"{' '.join(parts).removeprefix('+ ')} ({np.sqrt(value):.1f} times the usual)")
    return tuple(out)
