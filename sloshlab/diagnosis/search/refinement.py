"""What is done with explanations that were found: to where they converge, one effect less, the baseline again."""

from __future__ import annotations

from collections.abc import Sequence

from sloshlab.diagnosis.candidate import Candidate
from sloshlab.diagnosis.explanation import Explanation
from sloshlab.diagnosis.free_run_fit import STAGES, fitted
from sloshlab.diagnosis.search.fits import Fits, cheapest
from sloshlab.diagnosis.search.in_place import InPlace


class Refinement:
    """Better numbers of explanations.

    Parameters
    ----------
    fits : Fits
    """

    def __init__(self, fits: Fits) -> None:
        self.fits = fits
        self.in_place = InPlace(fits)

    def polished(self, known: Sequence[Explanation], pool: Sequence[Candidate]) -> list[Explanation]:
        """The best of one and of two effects to where they converge, special cases in their place, each alone."""
        found: list[Explanation] = []
        for n in (2, 1):
            best = cheapest([one for one in (*known, *found) if len(one.keys) == n])
            if best is None:
                continue
            self.fits.told(f"polishing {' and '.join(best.keys)}", 0, 1)
            fit, _ = fitted(self.fits.problem_of(best.fit), best.fit.values, n_iterations=10, shares=STAGES[-2:])
            if not fit.trouble and fit.cost < best.fit.cost:
                best = self.fits.judged(fit)
                found.append(best)
            found += self.in_place.specialised(best, [*known, *found], pool)
            if n > 1:
                found += self.take_away([best])
        return found

    def take_away(self, pairs: Sequence[Explanation]) -> list[Explanation]:
        """Each effect of the best pair alone, from the numbers that it has there: one of them may be enough."""
        pair = cheapest(pairs)
        if pair is None:
            return []
        found = []
        for i, candidate in enumerate(pair.fit.candidates):
            self.fits.told(f"taking away one of two effects: {candidate.key} is left", i, len(pair.keys))
            problem = self.fits.problem((candidate,))
            fit, _ = fitted(problem, pair.fit.values, shares=STAGES[-2:])
            if not fit.trouble:
                found.append(self.fits.judged(fit))
        return found

    def retuned_from(self, known: Sequence[Explanation], retuned: Explanation) -> Explanation:
        """The retuned baseline from where the best explanations have it: what an effect gains must be its own."""
        best = retuned
        for chosen in (cheapest(known), min(known, key=lambda one: one.held_out, default=None)):
            if chosen is None:
                continue
            self.fits.told("retuning the baseline from an explanation", 0, 1)
            fit, _ = fitted(
                self.fits.problem_of(retuned.fit), chosen.fit.values, n_iterations=10, shares=STAGES[-2:]
            )
            if not fit.trouble and fit.cost < best.fit.cost:
                best = self.fits.judged(fit)
        return best
