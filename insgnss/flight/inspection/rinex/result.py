"""The inspection of a directory with RINEX and no IMU: what there is, and the PPK it allows."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ....base.errors import DataError, InsgnssError
from ....base.files import pick_attributes
from ....base.wording import command_line, some
from ....geodesy.frames import ecef_to_geodetic
from ....report.document import Document, Section, Table
from ....report.notebook import Shown
from ....report.verdict import worst_of
from ..draft import Draft, write_draft
from .survey import FULL_SYSTEM_NAMES, Receiver, Survey

RINEX_DRAFT_REMARKS = (
    "Drafted by insgnss inspect from RINEX. `insgnss ppk` computes the positions of antenna and "
    "camera from it; `insgnss process` also needs a table [imu].",
)
POSITION_WHY = (
    "from the base's RINEX header, usually approximate; give the station's coordinates and the "
    "point (apc, arp, marker) that they belong to"
)


@dataclass(frozen=True)
class RinexInspection(Shown):
    """RINEX files of a recording without IMU, and the draft of its PPK."""

    name: str
    survey: Survey
    written: tuple[Path, ...] = ()

    @property
    def missing(self) -> str:
        """What PPK lacks."""
        return self.survey.missing

    @property
    def refusal(self) -> InsgnssError | None:
        """What keeps the files from a solution."""
        return DataError(f"no PPK: {self.missing}") if self.missing else None

    def write(self, path: Path, force: bool = False) -> "RinexInspection":
        """Write the draft; return the inspection with the files written."""
        draft = Draft(remarks=RINEX_DRAFT_REMARKS)
        draft.add("", "name", self.name)
        draft.add("imu", "file", "imu.csv", "the files hold no IMU samples", False)
        draft_raw_gnss(draft, self.survey)
        draft.add("output", "directory", "results")
        return replace(self, written=tuple(write_draft(draft, path, force)))

    def command(self) -> str:
        """Return the command line that solves the positions."""
        s = self.survey
        assert s.rover is not None
        assert s.base is not None
        arguments = ["insgnss", "ppk", *map(str, s.rover.files), "--base", *map(str, s.base.files)]
        arguments += ["--navigation", *map(str, s.navigation)]
        return command_line(arguments)

    def summary(self) -> str:
        """Return the text for the terminal."""
        s, refusal = self.survey, self.refusal
        files = []
        for r in s.receivers:
            names = some((file.name for file in r.files), 4)
            marker = r.header.marker or "no marker"
            files.append((_role(r, s), f"{names} ({marker}): {r.described}"))
        if s.navigation:
            named = ", ".join(f"{FULL_SYSTEM_NAMES.get(k, k)} {n}" for k, n in s.messages.items())
            of = ", ".join(file.name for file in s.navigation)
            files.append(("navigation", f"{of}: satellites {named}"))
        return Document(
            self.name,
            self.name,
            worst_of(
                f"the rover is {s.rover.files[0].name}: {s.why}" if s.rover else "",
                severe=[str(refusal)] if refusal else [],
            ),
            (
                Section("Files", [Table(files)]),
                Section("Left out", [f"{path}: {why[:120]}" for path, why in s.left_out[:8]]),
            ),
            files=self.written,
            next="" if self.missing else f"next: {self.command()}",
        ).text()

    def as_dict(self) -> dict[str, Any]:
        """Return the inspection for JSON output."""
        s = self.survey
        return {
            "name": self.name,
            "receivers": [_document(receiver, s) for receiver in s.receivers],
            "why": s.why,
            "navigation": [str(path) for path in s.navigation],
            "messages": s.messages,
            "left_out": {str(path): why for path, why in s.left_out},
            "missing": self.missing,
            "command": "" if self.missing else self.command(),
            "written": [str(path) for path in self.written],
        }


def _role(receiver: Receiver, survey: Survey) -> str:
    return "rover" if receiver is survey.rover else "base" if receiver is survey.base else "other"


def _document(receiver: Receiver, survey: Survey) -> Mapping[str, Any]:
    return {
        "role": _role(receiver, survey),
        "files": [str(path) for path in receiver.files],
        **pick_attributes(receiver.header, "marker", "receiver", "antenna"),
        "antenna_delta_m": receiver.header.antenna_delta_m.tolist(),
        "rinex": receiver.header.version,
        "minutes": (receiver.last_s - receiver.first_s) / 60.0,
        **pick_attributes(
            receiver, "interval_s", "epochs", "gaps", "events", "satellites", "bands"
        ),
    }


def draft_raw_gnss(draft: Draft, survey: Survey) -> None:
    """Add the keys of table [gnss] by which the flight is solved from RINEX.

    Parameters
    ----------
    draft : Draft
        Gets the keys.
    survey : Survey
        With rover, base and navigation files.
    """
    rover, base = survey.rover, survey.base
    assert rover is not None
    assert base is not None
    draft.add("gnss", "rover", _files(rover), f"{survey.why}: {rover.described}")
    draft.add("gnss", "base", _files(base), base.described)
    draft.add("gnss", "navigation", list(survey.navigation))
    if base.header.approx_position_m is not None:
        lat, lon, height = ecef_to_geodetic(base.header.approx_position_m)
        plan = [round(float(np.degrees(x)), 9) for x in (lat, lon)]
        draft.add("gnss", "base_position", [*plan, round(float(height), 4)], POSITION_WHY, False)
        draft.add("gnss", "base_point", "marker", "or apc, arp", False)


def _files(receiver: Receiver) -> Path | list[Path]:
    return receiver.files[0] if len(receiver.files) == 1 else list(receiver.files)
