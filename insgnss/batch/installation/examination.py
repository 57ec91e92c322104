"""All that `insgnss doctor` looks at, in its order.

`machine_findings` and its neighbours look at where insgnss runs.
"""

import os
import platform
import re
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

from ...base import __version__
from ...base.beside import processors
from ...base.caches import KERNELS_AT
from ...base.errors import InsgnssError
from ...base.findings import Finding, Question, Verdict
from ...base.memory import available
from ...base.provenance import installed_version
from ...base.shipped import NUMBA_VARIABLES, read_processor
from .packages import package_findings

GRIDS = (".tif", ".gtx", ".gsb")
CPUINFO = Path("/proc/cpuinfo")


def machine_findings(cpuinfo: Path = CPUINFO) -> list[Finding]:
    """Return versions, operating system, processors and memory.

    Parameters
    ----------
    cpuinfo : Path
        Where Linux names its processor.

    Returns
    -------
    list of Finding
        One a line.
    """
    return [
        _machine("insgnss").ok(f"{__version__} in {Path(__file__).parents[2]}"),
        _installed_version(),
        _machine("Python").ok(f"{platform.python_version()}, {sys.executable}"),
        _machine("operating system").ok(platform.platform()),
        _machine("processor").ok(f"{_processor(cpuinfo)}, {processors()} to be used"),
        _memory(),
    ]


def kernel_findings(kernel: Any) -> list[Finding]:
    """Return where compiled kernels are kept, whether that can be written, and what is shipped.

    Parameters
    ----------
    kernel : dispatcher
        A function of the core, whose place stands for all.

    Returns
    -------
    list of Finding
        One line, and one more of a platform wheel.
    """
    return [_cache_finding(kernel), *_shipped_findings(read_processor())]


def _shipped_findings(shipped: dict[str, Any]) -> list[Finding]:
    """Return whether the kernels that the wheel ships are used."""
    if not shipped:
        return []
    question = Question("shipped", topic="kernels")
    name, version = shipped["name"], shipped["llvmlite"]
    origin = f"for {name} by llvmlite {version}"
    if os.environ.get(NUMBA_VARIABLES[0]) == name and metadata.version("llvmlite") == version:
        return [question.ok(origin)]
    advice = f"pip install llvmlite=={version}, if this computer's processor is a {name}"
    return [
        question.note(
            f"kernels {origin}, not used here; the first run compiles them",
            advice,
        )
    ]


def _cache_finding(kernel: Any) -> Finding:
    """Return where compiled kernels are kept."""
    cache, directory = Question("cache", topic="kernels"), os.environ.get(KERNELS_AT)
    origin = f" ({KERNELS_AT})" if directory else ""
    path = getattr(getattr(kernel, "_cache", None), "cache_path", None)
    if path is None:
        advice = f"unset NUMBA_DISABLE_JIT, or set {KERNELS_AT} to a directory that you can write"
        value = "no cache: every command interprets the kernels or compiles them anew"
        return cache.note(value, advice)
    if _writable(Path(path)):
        return cache.ok(f"{path}{origin}, writable")
    advice = f"set {KERNELS_AT} to a permanent directory that you can write"
    return cache.note(f"{path}{origin} cannot be written", advice)


def grid_findings() -> list[Finding]:
    """Return PROJ's version, its directories with how many grids they hold, and its network.

    Returns
    -------
    list of Finding
        One a line.
    """
    from pyproj import proj_version_str
    from pyproj.datadir import get_data_dir, get_user_data_dir
    from pyproj.network import is_network_enabled

    shipped, user = get_data_dir(), get_user_data_dir()
    directories = dict.fromkeys(Path(name) for name in (user, *shipped.split(os.pathsep)))
    counts = {directory: sum(1 for _ in _grids(directory)) for directory in directories}
    held = ", ".join(f"{count} in {directory}" for directory, count in counts.items())
    get = (
        "grids are needed only for heights above sea level and datum shifts; `pyproj sync --file "
        "NAME` downloads one grid, `pyproj sync --bbox WEST,SOUTH,EAST,NORTH` all grids of an area"
    )
    network = (
        "on: PROJ may download grids during a run; set PROJ_NETWORK=OFF for results that do not"
        " depend on the network"
        if is_network_enabled()
        else "off: only grids on this disk are used"
    )
    verdict: Verdict = "ok" if any(counts.values()) else "note"
    return [
        Question("PROJ", topic="grids").ok(f"{proj_version_str}, data in {shipped}"),
        Finding("geoids and datum shifts", held, "", verdict, get, topic="grids"),
        Question("network", topic="grids").ok(network),
    ]


def engine_finding() -> Finding:
    """Return the engine that `insgnss ppk` would take.

    Returns
    -------
    Finding
        One line.
    """
    from ...gnss.engine.program import MODULE, engine_command

    engine = Question("engine", topic="ppk")
    try:
        command = engine_command()
    except InsgnssError as error:
        advice = f"{error}; only `insgnss ppk` and flights with raw GNSS observations need it"
        return engine.note("none", advice)
    if command[0] != sys.executable:
        return engine.ok(f"{command[0]}; the version is known only after the first solution")
    return engine.ok(f"{MODULE} {metadata.version(MODULE)} (RTKLIB as a wheel)")


def _installed_version() -> Finding:
    """Whether what pip knows is what runs."""
    installed = _machine("installed as")
    version = installed_version("insgnss")
    if version is None:
        value, advice = (
            "insgnss is not installed: it runs from its source directory",
            "run pip install . in that directory",
        )
        return installed.note(value, advice)
    if version == __version__:
        return installed.ok(version)
    advice = "pip install . again, or unset PYTHONPATH"
    return installed.note(f"{version}, but {__version__} runs", advice)


def _processor(cpuinfo: Path) -> str:
    try:
        match = re.search(r"^model name\s*:\s*(.+)$", cpuinfo.read_text("utf-8"), re.MULTILINE)
    except OSError:
        match = None
    return f"{match[1].strip() if match else platform.processor() or 'unknown'}, " + (
        platform.machine()
    )


def _memory() -> Finding:
    memory, free = _machine("memory"), available()
    if free is None:
        return memory.answer("unknown: the system does not say", "unknown")
    return memory.ok(f"{free / 1e9:.3g} GB available")


def _machine(name: str) -> Question:
    return Question(name, topic="machine")


def _writable(directory: Path) -> bool:
    """Whether a file can be made there: tried, as permissions do not tell all."""
    try:
        directory.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=directory):
            return True
    except OSError:
        return False


def _grids(directory: Path) -> Iterator[Path]:
    try:
        yield from (file for file in directory.iterdir() if file.suffix.lower() in GRIDS)
    except OSError:
        return


EXAMINATION_MARKS = {"ok": "ok", "note": "note", "unknown": "?", "contradiction": "WRONG"}
EXAMINATION_WORDS = {"ok": "good", "contradiction": "defect"}  # of the verdicts for machines


@dataclass(frozen=True)
class Examination:
    """What was found.

    Parameters
    ----------
    findings : tuple of Finding
        One a line.
    """

    findings: tuple[Finding, ...]

    @property
    def refusal(self) -> InsgnssError | None:
        """Why insgnss does not work here, with exit code 1; None where it does."""
        wrong = [f"{f.name}: {f.sentence}" for f in self.findings if f.verdict == "contradiction"]
        return InsgnssError("; ".join(wrong)) if wrong else None

    def summary(self) -> str:
        """Return the text for the terminal."""
        width = max(len(f.name) for f in self.findings)
        lines, topic = [], ""
        for f in self.findings:
            if f.topic != topic:
                topic = f.topic
                lines.append(topic)
            lines.append(f"  {EXAMINATION_MARKS[f.verdict]:5} {f.name:{width}}  {f.sentence}")
        count = Counter(f.verdict for f in self.findings)
        result = "does not work here" if self.refusal else "works here"
        last = (
            f"insgnss {result}; {len(self.findings)} lines: {count['ok']} ok, {count['note']} "
            f"notes, {count['unknown']} unknown, {count['contradiction']} wrong"
        )
        return "\n".join([*lines, last])

    def as_dict(self) -> dict[str, Any]:
        """Return the document for machines."""
        return {
            "works": self.refusal is None,
            "findings": [
                {
                    "topic": f.topic,
                    "name": f.name,
                    "value": f.found,
                    "verdict": EXAMINATION_WORDS.get(f.verdict, f.verdict),
                    "advice": f.advice,
                }
                for f in self.findings
            ],
        }


def examine(progress: Callable[[str], None], compiling: bool = False) -> Examination:
    """Look at everything.

    What cannot be loaded is a finding of its own, and the rest is looked at all the same.

    Parameters
    ----------
    progress : callable
        Gets the name of each step.
    compiling : bool
        Compile the kernels of `process` and `demo` ahead, rather than the self-test's alone.

    Returns
    -------
    Examination
        All findings.
    """
    progress("machine")
    findings = machine_findings()
    progress("packages, each imported in another process")
    findings += package_findings()
    if compiling:
        findings += _look_safely("kernels", lambda: _compile_kernels(progress))
    progress("compiled kernels; the first compilation takes up to a minute")
    findings += _look_safely("kernels", _core)
    progress("grids and engine")
    findings += _look_safely("grids", grid_findings)
    findings += _look_safely("ppk", lambda: [engine_finding()])
    return Examination(tuple(findings))


def _compile_kernels(progress: Callable[[str], None]) -> list[Finding]:
    """Compile the kernels ahead."""
    from .compiling import compile_all

    return [compile_all(progress)]


def _core() -> list[Finding]:
    """Look at the kernels and run the self-test."""
    from ...navigation.filter.kernels.strapdown import run_strapdown
    from .self_test import self_test

    return [*kernel_findings(run_strapdown), self_test().finding()]


def _look_safely(topic: str, look: Callable[[], list[Finding]]) -> list[Finding]:
    """Return what `look` finds, or that it failed, whatever the reason."""
    try:
        return look()
    except Exception as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        advice = "see the packages above; pip install --force-reinstall insgnss"
        return [Question("loading", topic=topic).contradiction(f"fails: {reason}", advice)]
