"""The packages that insgnss asks for, by its own metadata: there, new enough, importable?

Which they are is read from the metadata of the installed package (`pyproject.toml` when it was
built), so that there is no second list. Each is imported in a process of its own beside this one,
since a broken library may end the process that loads it.
"""

import re
import subprocess
import sys
from importlib import metadata
from typing import NamedTuple

from ...base.findings import Finding, Question
from ...base.provenance import installed_version

IMPORT_S = 60.0  # for all packages to load (s): a library that takes longer hangs (chosen)
_REQUIREMENT = re.compile(r"([\w.-]+)\s*(?:\[[^]]*\])?\s*([^;]*)(?:;(.*))?")
_EXTRA = re.compile(r"extra\s*==\s*['\"]([\w.-]+)['\"]")
_IMPORTS = """
import importlib, sys, warnings
warnings.simplefilter("ignore")
for name in sys.argv[1:]:
    print("begins", name, flush=True)
    try:
        importlib.import_module(name)
    except BaseException as error:
        words = " ".join(f"{type(error).__name__}: {error}".split())
        print("\\nfails", name, words.encode("ascii", "replace").decode()[:200], flush=True)
    else:
        print("\\nimports", name, flush=True)
"""


class Requirement(NamedTuple):
    """One package that the metadata ask for.

    Parameters
    ----------
    name : str
        Of the distribution.
    least : str
        The lowest version, "" where any will do.
    extra : str
        The optional extra that asks for it, "" where insgnss does not run without.
    """

    name: str
    least: str
    extra: str


def requirements(package: str = "insgnss") -> list[Requirement]:
    """Return what the metadata of an installed package ask for, the necessary ones first.

    Parameters
    ----------
    package : str
        Name of the distribution.

    Returns
    -------
    list of Requirement
        One for every package and extra.

    Raises
    ------
    importlib.metadata.PackageNotFoundError
        Where the package is not installed, as when it runs from its sources alone.
    """
    out = []
    for line in metadata.requires(package) or ():
        match = _REQUIREMENT.match(line)
        assert match is not None
        name, versions, marker = match.groups()
        extra = _EXTRA.search(marker or "")
        minimum = re.search(r">=\s*([\w.]+)", versions)
        out.append(Requirement(name, minimum[1] if minimum else "", extra[1] if extra else ""))
    return sorted(out, key=lambda r: (r.extra, r.name))


def package_findings(package: str = "insgnss") -> list[Finding]:
    """Look at every package that the metadata ask for.

    Parameters
    ----------
    package : str
        Name of the distribution.

    Returns
    -------
    list of Finding
        One for each necessary package, and one for each optional extra.
    """
    try:
        needed = requirements(package)
    except metadata.PackageNotFoundError:
        value = "unknown: insgnss runs from its sources and is not installed as a package"
        return [
            Question("extras", topic="packages").answer(
                value, "unknown", "pip install . in the sources"
            )
        ]
    versions = {r.name: installed_version(r.name) for r in needed}
    modules = {name: module_of(name) for name, version in versions.items() if version}
    failures = import_failures([module for module in modules.values() if module])
    states = {
        r: _state(r, versions[r.name], failures.get(modules.get(r.name) or "", "")) for r in needed
    }
    necessary = [
        Question(r.name, topic="packages").contradiction(state, _upgrade(r, wrong), when=wrong)
        for r, (state, wrong) in states.items()
        if not r.extra
    ]
    optional = []
    for extra in sorted({r.extra for r in needed} - {""}):
        of_extra = {r: states[r] for r in needed if r.extra == extra}
        wrong = any(bad for _, bad in of_extra.values())
        value = ", ".join(f"{r.name} {state}" for r, (state, _) in of_extra.items())
        advice = f"pip install '{package}[{extra}]' where it is needed"
        optional.append(Question(extra, topic="extras").note(value, advice, when=wrong))
    return necessary + optional


def module_of(distribution: str) -> str | None:
    """Return the module by which an installed distribution is imported.

    Parameters
    ----------
    distribution : str
        Its name.

    Returns
    -------
    str or None
        The module or folder of modules that is named most alike; None where its files do not tell.
    """
    files = metadata.files(distribution) or ()
    names = {
        file.parts[0].partition(".")[0] for file in files if file.suffix in (".py", ".so", ".pyd")
    }
    public = sorted(name for name in names if name.isidentifier() and not name.startswith("_"))
    plain = re.sub(r"[-_.]+", "", distribution).lower()
    alike = [name for name in public if name.replace("_", "").lower() == plain]
    inside = [name for name in public if name.replace("_", "").lower() in plain]
    return next(iter([*alike, *inside, *public]), None)


def import_failures(modules: list[str]) -> dict[str, str]:
    """Import modules in another process and return why some cannot be.

    Parameters
    ----------
    modules : list of str
        Their names.

    Returns
    -------
    dict
        The reason by the name of the module, of those that fail, or end the process.
    """
    failures: dict[str, str] = {}
    remaining = list(dict.fromkeys(modules))
    while remaining:
        ending = ""
        try:
            finished = subprocess.run(
                [sys.executable, "-c", _IMPORTS, *remaining],
                capture_output=True,
                stdin=subprocess.DEVNULL,
                timeout=IMPORT_S,
                check=False,
            )
            output, ending = finished.stdout, f"ends its process (code {finished.returncode})"
        except subprocess.TimeoutExpired as error:
            output, ending = error.stdout or b"", f"takes more than {IMPORT_S:g} s"
        rows = [line.split(" ", 2) for line in output.decode("utf-8", "replace").splitlines()]
        failures |= {row[1]: row[2] for row in rows if row[0] == "fails" and len(row) == 3}
        ended = {row[1] for row in rows if row[0] in ("fails", "imports") and len(row) > 1}
        remaining = [module for module in remaining if module not in ended]
        if remaining:  # the first of them ended the process
            failures[remaining.pop(0)] = ending
    return failures


def _state(requirement: Requirement, version: str | None, failure: str) -> tuple[str, bool]:
    """Return what is there in words, and whether it will not do."""
    if version is None:
        return "missing", True
    if failure:
        return f"{version} cannot be imported ({failure})", True
    if _numbers(version) < _numbers(requirement.least):
        return f"{version} is older than {requirement.least}", True
    return version, False


def _numbers(version: str) -> tuple[int, ...]:
    return tuple(map(int, re.findall(r"\d+", re.split(r"[a-z+-]", version)[0])))


def _upgrade(requirement: Requirement, wrong: bool) -> str:
    minimum = f">={requirement.least}" if requirement.least else ""
    return f"pip install --upgrade '{requirement.name}{minimum}'" if wrong else ""
