"""One worked example of every rate law and element: a joint of a small arm that resists with about 5 N.m.

The pictures of the docs, the contract tests and `backdrive laws` run on these, so that laws can be compared by eye.
"""

from __future__ import annotations

from backdrive._catalog import lookup
from backdrive.laws import ELEMENTS, FORMER, RATES, Law, rate_law
from backdrive.laws.base import Element, Rate
from backdrive.laws.direction import BEHIND

RATE_EXAMPLES: dict[str, Rate] = {name: law(**law.EXAMPLE) for name, law in RATES.items()}
ELEMENT_EXAMPLES: dict[str, Element] = {name: law(**law.EXAMPLE) for name, law in ELEMENTS.items()}


def example(name: str) -> Law:
    """Return the example of a law: a rate law by itself, an element under Gauss' Stribeck curve, or `rate+element`."""
    rate, plus, carrier = (FORMER.get(part, part) for part in name.partition("+"))
    if plus or rate.endswith(BEHIND):
        kind = rate_law(rate)
        element = lookup(carrier or "none", ELEMENT_EXAMPLES, "presliding element")
        return Law(rate=kind(**kind.EXAMPLE), element=element)
    known = RATE_EXAMPLES | ELEMENT_EXAMPLES
    found = lookup(rate, known, "friction law")
    return (
        Law(rate=found)
        if isinstance(found, Rate)
        else Law(rate=RATE_EXAMPLES["stribeck-gauss"], element=found)
    )
