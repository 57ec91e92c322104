"""The page of a tuning on a flight: verdict, spectra, factors, innovations before and after."""

from typing import TYPE_CHECKING

from ....report.verb_page import VerbPage, listed, preformatted, tabulated
from .spectrum import spectra
from .words import NAMES, spectrum_lines, whiteness_rows

if TYPE_CHECKING:
    from .result import FlightTuning


def flight_page(tuning: "FlightTuning", twin: str) -> VerbPage:
    """Return the page of a tuned flight.

    Parameters
    ----------
    tuning : FlightTuning
        With the names of its files.
    twin : str
        Text of the table for machines.

    Returns
    -------
    VerbPage
        With the spectra of straight flight, where there was any.
    """
    n = tuning.noise
    largest = ", ".join(
        f"{NAMES[name]} x {f:.3f} ± {f * sigma:.3f}"
        for name, f, sigma in zip(n.names, n.factor, n.log_sigma, strict=True)
        if sigma > 0.0
    )
    mood = "good" if tuning.accepted else "doubtful"
    factors = [
        (NAMES[name], f"{f:.3f}", f"{f * sigma:.3f}" if sigma else "held")
        for name, f, sigma in zip(n.names, n.factor, n.log_sigma, strict=True)
    ]
    head = ("innovations of the positions", "before", "after")
    return VerbPage(
        f"{tuning.name}: noise of the IMU in flight",
        f"{tuning.headline}: {largest or 'nothing was determined'}, from"
        f" {n.duration_s / 60.0:.1f} min in motion",
        mood,
        "; ".join(tuning.reasons),
        spectra(tuning),
        parts=(
            tabulated("Factors on the static model", factors, ("", "factor", "standard error")),
            listed("Held", [f"{NAMES[name]}: {why}" for name, why in n.held]),
            tabulated("Innovations", whiteness_rows(n.before, n.after), head, numbers=True),
            preformatted("Spectrum", spectrum_lines(tuning)),
            listed("Notes", tuning.notes),
        ),
        hashes={r.file: r.sha256 for r in tuning.model.recordings},
        settings={"static model": tuning.static.name, "key of the flight file": tuning.key},
        twin=twin,
    )
