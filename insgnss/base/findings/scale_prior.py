"""What is known of a source before a flight: how well the sigmas that it claims hold."""

import math
from dataclasses import dataclass

WIDE_FACTOR = 2.0  # of a prior's width, within which 95 % of flights are: nothing to say


@dataclass(frozen=True)
class ScalePrior:
    """What is known before a flight of the factor k that makes a source's sigmas right.

    log k is normal. The innovations of one flight tell it to a per cent or, of a minute of fixes at
    1 Hz, to a tenth; what is adopted is the mean a posteriori, below 1 only where withheld
    pieces of the flight are predicted with it (`navigation.diagnosis.variances`).

    Parameters
    ----------
    mean, width : float
        Mean and standard deviation of log k; of infinite width nothing is known.
    """

    mean: float = 0.0
    width: float = math.inf

    @property
    def usual(self) -> float:
        """The k, at least 1, up to which sigmas are as usual of the source: nothing to say."""
        if math.isinf(self.width):
            return 1.0
        return max(1.0, math.exp(self.mean + WIDE_FACTOR * self.width))

    def posterior(self, log_k: float, variance: float) -> tuple[float, float]:
        """Return what is known of log k after a flight, and what the prior takes off its evidence.

        With L the likelihood of the flight, a normal curve of this variance about its maximum m,
        and N the prior,

            log integral L N dk - log max L
                = -(m - mean)^2 / (2 (variance + width^2)) - log(1 + width^2 / variance) / 2

        Parameters
        ----------
        log_k, variance : float
            The maximum of the likelihood, and the variance of log k there.

        Returns
        -------
        log_k : float
            Mean a posteriori.
        loss : float
            The negative of the above.
        """
        total = variance + self.width**2
        missed = self.mean - log_k
        loss = 0.5 * (missed**2 / total + math.log(total / variance))
        return log_k + variance / total * missed, loss


UNKNOWN_SCALE = ScalePrior()
"""Of a source of which nothing is known: every factor is said."""
