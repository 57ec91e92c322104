"""What the room says, in the words of its verb: where a message names a key of a flight file, the option that stands for it."""

import re
from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..records import Check

OPTIONS = {
    "acceleration_mps2": "--acceleration",
    "base_point": "--base-point",
    "base_position": "--base-position",
    "delay_s": "--camera-delay",
    "elevation_mask_deg": "--mask",
    "events_containing": "--events-containing",
    "image_ending": "--image-ending",
    "invalid_events": "--invalid-events",
    "max_age_s": "--max-age",
    "pressure_hpa": "--pressure",
    "skip_events": "--skip-events",
    "skip_images": "--skip-images",
    "temperature_c": "--temperature",
    "timeout_s": "--timeout",
}
ALSO_PROSE = ("antex", "engine", "frequencies", "humidity", "images", "more", "ratio", "systems")  # keys of table, value or colon only
_PROSE, _TABLE = "|".join(ALSO_PROSE), r"(?:gnss|camera|atmosphere)\."
_WORD = rf"(?:{_TABLE})?(?:{'|'.join(OPTIONS)})|{_TABLE}(?:{_PROSE})|(?:{_PROSE})(?= = )|^(?:{_PROSE})(?=: )"
_VALUE = r"(?: = (?P<value>\[[^\]]*\]|\([^)]*\)|'[^']*'|[\w.+-]*\w))?"
_KEY = re.compile(rf"(?<![\w./-])(?P<key>{_WORD})(?![\w/]|\.\w){_VALUE}(?: \((?:ppk: )?--[a-z-]+\))?")


def in_options(text: str) -> str:
    """`text` with the options of the verb, and their values as the command line takes them, in place of keys of a flight file."""
    said = _KEY.sub(_option, text)
    return f"ppk: {said}" if said.startswith("--") else said


def check_in_options(check: "Check") -> "Check":
    """A check whose words are those of the verb."""
    found, expected, advice = (_KEY.sub(_option, text) for text in (check.found, check.expected, check.advice))
    return replace(check, found=found, expected=expected, advice=advice)


def _option(found: re.Match[str]) -> str:
    key, value = found["key"].rpartition(".")[2], found["value"]
    option = OPTIONS.get(key, f"--{key}")
    if value is None or value in ("true", "false"):
        return option
    return f"{option} {value.strip('[()]').replace(', ', ' ')}"
