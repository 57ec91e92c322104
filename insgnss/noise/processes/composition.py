"""Which processes a noise model is made of, by name: "WN+3GM", "QN+WN+2GM+RW".

    QN  quantization        WN  white noise        GM  first-order Gauss-Markov process, AR1 when
                                                       sampled (up to five)
    RW  random walk         DR  drift

A composition orders its parameters QN, WN, then correlation time and driving noise of each
Gauss-Markov process from the shortest time to the longest, RW, DR. All are of continuous time, in
the units of `model.AxisNoise`, so they do not depend on the sampling rate. Processes that no
variance of differences shows (turn-on bias) or that need motion (scale factor, misalignment) are
not part of it.
"""

import difflib
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.errors import UsageError
from ...navigation.noise_model.model import AxisNoise, GaussMarkov
from ...records import Array

MOST_GAUSS_MARKOV = 5  # of one axis (chosen)
GAUSS_MARKOV, CORRELATION_TIME, DRIVING = "gauss_markov", "correlation_time", "driving_noise"
_LINEAR = {"QN": "quantization", "WN": "white_noise", "RW": "random_walk", "DR": "drift"}
_ALIASES = {name: name for name in ("QN", "WN", "GM", "RW", "DR")} | {"AR1": "GM", "AR(1)": "GM"}
_TERM = re.compile(r"([0-9]*)\s*\*?\s*([^\s*].*)")


@dataclass(frozen=True)
class NoiseTerm:
    """A process of a composition, or a parameter of one.

    kind : the field of `AxisNoise`, or of a Gauss-Markov process `CORRELATION_TIME` or `DRIVING`.
    number : that of the Gauss-Markov process from the shortest time on, 0 of another process.
    """

    kind: str
    number: int = 0

    def __str__(self) -> str:
        return f"{self.kind}_{self.number}" if self.number else self.kind

    @property
    def parameters(self) -> tuple["NoiseTerm", ...]:
        """Those of a process."""
        kinds = (CORRELATION_TIME, DRIVING) if self.kind == GAUSS_MARKOV else (self.kind,)
        return tuple(NoiseTerm(kind, self.number) for kind in kinds)


@dataclass(frozen=True)
class Composition:
    """The processes of a sum: each of four at most once, and a number of Gauss-Markov processes,
    not all absent.
    """

    quantization: bool = False
    white_noise: bool = False
    random_walk: bool = False
    drift: bool = False
    gauss_markov: int = 0

    def __post_init__(self) -> None:
        if not 0 <= self.gauss_markov <= MOST_GAUSS_MARKOV:
            raise UsageError(
                f"{self.gauss_markov} Gauss-Markov processes; give from 0 to {MOST_GAUSS_MARKOV}"
            )
        if not (self.gauss_markov or self.linear):
            raise UsageError("a noise model without any process; name some, as in 'WN+2GM'")

    @classmethod
    def parse(cls, text: str) -> "Composition":
        """Composition of a sum such as "WN+3GM", in any order and case. Raises UsageError, naming
        the nearest process of a typo.
        """
        count = dict.fromkeys(("QN", "WN", "GM", "RW", "DR"), 0)
        for term in text.split("+"):
            number, name = _term(term, text)
            count[name] += number
        for name, parameter in _LINEAR.items():
            if count[name] > 1:
                raise UsageError(
                    f"{text}: {name} stands {count[name]} times, and a sum of them is one"
                    f" {parameter.replace('_', ' ')}; write it once"
                )
        if count["GM"] > MOST_GAUSS_MARKOV:
            raise UsageError(
                f"{text}: {count['GM']} Gauss-Markov processes, the most is {MOST_GAUSS_MARKOV}; a"
                " recording seldom shows more than 3"
            )
        return cls(
            **{parameter: count[name] == 1 for name, parameter in _LINEAR.items()},
            gauss_markov=count["GM"],
        )

    def __str__(self) -> str:
        letters = {parameter: name for name, parameter in _LINEAR.items()}
        letters[GAUSS_MARKOV] = f"{self.gauss_markov}GM" if self.gauss_markov > 1 else "GM"
        return "+".join(dict.fromkeys(letters[process.kind] for process in self.processes))

    @property
    def linear(self) -> tuple[str, ...]:
        """Names in `AxisNoise` of the processes with one parameter."""
        return tuple(p for p in _LINEAR.values() if getattr(self, p))

    @property
    def processes(self) -> tuple[NoiseTerm, ...]:
        """The processes in their order."""
        linear = [NoiseTerm(kind) for kind in self.linear]
        first = self.quantization + self.white_noise
        gm = [NoiseTerm(GAUSS_MARKOV, k) for k in range(1, self.gauss_markov + 1)]
        return (*linear[:first], *gm, *linear[first:])

    @property
    def terms(self) -> tuple[NoiseTerm, ...]:
        """The parameters in their order."""
        return tuple(term for process in self.processes for term in process.parameters)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters in their order."""
        return tuple(map(str, self.terms))

    @property
    def is_time(self) -> NDArray[np.bool_]:
        """(size,) bool, which parameters are correlation times."""
        return np.array([term.kind == CORRELATION_TIME for term in self.terms], dtype=bool)

    @property
    def size(self) -> int:
        """Number of parameters."""
        return len(self.linear) + 2 * self.gauss_markov

    def axis(self, values: Sequence[float] | Array) -> AxisNoise:
        """Processes of the parameters (size,), in the order of `parameters`; Gauss-Markov processes
        are put in order of their times.

        Raises UsageError where their number differs, and InputError where one is not admissible
        (negative, not finite).
        """
        if len(values) != self.size:
            raise UsageError(
                f"{len(values)} values for the {self.size} parameters of {self}:"
                f" {', '.join(self.parameters)}"
            )
        named = dict(zip(self.terms, map(float, values), strict=True))
        linear: dict[str, Any] = {kind: named[NoiseTerm(kind)] for kind in self.linear}
        pairs = [[named[t] for t in p.parameters] for p in self.processes if p.number]
        gm = (GaussMarkov(*pair) for pair in sorted(pairs, key=lambda pair: pair[0]))
        return AxisNoise(**linear, gauss_markov=tuple(gm))

    def values(self, axis: AxisNoise) -> Array:
        """Parameters (size,) of an axis, in the order of `parameters`.

        Raises UsageError where the axis has other processes. Turn-on bias, scale factor and
        misalignment are left aside.
        """
        further = [p for p in _LINEAR.values() if getattr(axis, p) and not getattr(self, p)]
        if further or len(axis.gauss_markov) != self.gauss_markov:
            present = ", ".join([*further, f"{len(axis.gauss_markov)} Gauss-Markov"])
            raise UsageError(
                f"an axis with {present} processes is not of {self}; take `composition_of`"
            )
        gm = sorted(axis.gauss_markov, key=lambda p: p.correlation_time_s)
        pairs = {k: (p.correlation_time_s, p.driving_noise) for k, p in enumerate(gm, start=1)}
        values = [pairs.get(p.number) or (getattr(axis, p.kind),) for p in self.processes]
        return np.array([value for of_process in values for value in of_process])


def composition_of(axis: AxisNoise) -> Composition:
    """Return the processes that an axis has.

    Raises
    ------
    UsageError
        Where it has none.
    """
    return Composition(
        **{p: getattr(axis, p) > 0.0 for p in _LINEAR.values()}, gauss_markov=len(axis.gauss_markov)
    )


def families(largest: Composition) -> tuple[Composition, ...]:
    """Return all compositions of processes of `largest`, itself included.

    They are in order of the number of parameters and then of the name.
    """
    compositions = []
    for switch in range(2 ** len(largest.linear)):
        chosen: dict[str, Any] = {
            name: True for i, name in enumerate(largest.linear) if switch >> i & 1
        }
        compositions += [
            Composition(**chosen, gauss_markov=k)
            for k in range(largest.gauss_markov + 1)
            if k or chosen
        ]
    return tuple(sorted(compositions, key=lambda c: (c.size, str(c))))


def _term(term: str, text: str) -> tuple[int, str]:
    """Number and name of one summand."""
    match = _TERM.fullmatch(term.strip())
    if match is None:
        raise UsageError(f"{text!r}: a process is missing; write a sum such as 'WN+2GM'")
    number = int(match[1]) if match[1] else 1
    name = match[2].strip().upper().removesuffix("()")
    if name not in _ALIASES:
        near = difflib.get_close_matches(name, _ALIASES, n=3, cutoff=0.3)
        near.sort(key=lambda alias: alias[0] != name[0])
        hint = (
            f"did you mean {near[0]!r}?"
            if near
            else f"known are {', '.join(dict.fromkeys(_ALIASES.values()))}"
        )
        raise UsageError(f"{text}: unknown process {name!r}, {hint}")
    if number < 1:
        raise UsageError(f"{text}: {number} {name}; leave out what is absent")
    return number, _ALIASES[name]
