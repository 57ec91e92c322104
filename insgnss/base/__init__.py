"""What every wing stands on: errors, files, trust in files of others, units, compiled code.

It imports no other wing, and every wing imports it.

The way of the data: files come in by one door (`inputs.py`), TOML files by `tables.py`, whose
refusals name the line. A refusal is an error of `errors.py` with its exit code. Products are
written to a scratch directory (`output/`), moved into place all together or not at all, and say
what they were made from (`provenance.py`).

Where to look
    the version: `__version__` below
    errors and their exit codes: `errors.py`; how a message names an option: `wording.py`
    what is found of data, with a verdict and what to do: `findings/`
    files that appear together: `output/staging.py` on the directories of `scratch.py`, with
        signals held back by `interrupts.py`; moves of a killed run: `output/unfinished.py`
    what a file may do that somebody sent: be written for below its own directory
        (`received/outputs.py`), have its own text in messages (`trusted.py` there, asked by
        `errors.py`), cost what its size accounts for (`received/nesting.py`, `unpacking.py`;
        `insgnss/io/formats/text/xml.py`, `database.py` there)
    what installed packages add by entry points: `received/plugins.py`
    which file a key of a flight file came from: `Source` in `tables.py`
    units of noise models: `units.py` (units of a header: `insgnss/io/formats/text/headers.py`)
    the cache of compiled kernels: `compilation/`, where it is `caches.py`, what a platform wheel
        ships: `shipped.py`; the helpers that fill
        it in a first run `ahead.py`, by the list `kernels.json`
    memory that is available: `memory.py`; a second thread: `beside.py`; how far a step has come:
        `advance.py`
    quantiles of the normal and chi-square distributions: `quantiles.py`
"""

__version__ = "0.2.0"
