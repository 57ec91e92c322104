"""`insgnss report`: a page as a PDF to hand over, printed by a browser that is installed.

A page prints as a summary; its appendix, which is all the rest, where it is asked for.
"""

import os
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from ..base.errors import InputError, UsageError
from ..base.output.staging import staged_path
from .charts.files import charts_of
from .document import APPENDIX

BROWSERS = (
    *("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome"),
    *("msedge", "microsoft-edge"),
)
PRINTED_WITHIN_S = 300.0  # of printing, s: a page of 5000 images with its appendix takes 60


@dataclass(frozen=True)
class Printed:
    """The PDF, of which page, and by which browser."""

    page: Path
    file: Path
    browser: str

    def summary(self) -> str:
        """Return the text for the terminal."""
        return f"{self.page}, printed by {self.browser}\nwrote {self.file}"

    def as_dict(self) -> dict[str, Any]:
        """Return the document for machines."""
        return {"page": str(self.page), "file": str(self.file), "browser": self.browser}


def print_page(
    source: Path, pdf: Path | None = None, appendix: bool = False, force: bool = False
) -> Printed:
    """Print a page to a PDF.

    Parameters
    ----------
    source : Path
        A page of insgnss, or the JSON document beside it.
    pdf : Path, optional
        The file; by default the page's name with the ending .pdf.
    appendix : bool
        Print what is not in the summary as well.
    force : bool
        Overwrite the file.

    Returns
    -------
    Printed
        The file.

    Raises
    ------
    InputError
        The page is not there, of another run or damaged.
    UsageError
        The file exists already, or no browser is installed or prints.
    """
    page, _ = charts_of(source)
    file = page.with_suffix(".pdf") if pdf is None else pdf
    if file.exists() and not force:
        raise UsageError(f"report: {file} exists; give another --pdf, or overwrite with --force")
    browser = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    if browser is None:
        raise UsageError(
            f"report: none of {', '.join(BROWSERS)} is on the path; install one, or print"
            f" {page} from any browser"
        )
    with TemporaryDirectory(prefix="insgnss-") as profile, staged_path(file) as out:
        options = ["--headless", "--disable-gpu", "--no-first-run", "--no-pdf-header-footer"]
        if getattr(os, "geteuid", lambda: 1)() == 0:
            options.append("--no-sandbox")  # root has none
        address = page.resolve().as_uri() + (f"#{APPENDIX}" if appendix else "")
        command = [browser, *options, f"--user-data-dir={profile}", f"--print-to-pdf={out}"]
        try:
            browser_run = subprocess.run(
                [*command, address], capture_output=True, timeout=PRINTED_WITHIN_S, check=False
            )
        except subprocess.TimeoutExpired:
            problem = f"{browser} did not end in {PRINTED_WITHIN_S:.0f} s"
            raise InputError.in_file(page, f"{problem}; print it from a browser") from None
        if browser_run.returncode or not out.is_file():
            message = browser_run.stderr.decode(errors="replace").strip().splitlines()[-1:]
            problem = f"{browser} did not print it ({' '.join(message)[:200]})"
            raise InputError.in_file(page, f"{problem}; print it from a browser")
    return Printed(page, file, browser)
