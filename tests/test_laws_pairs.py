"""Every rate law under every element that can carry it: the examples, held to every property of an element.

`test_laws_elements.py` draws the pairs and their parameters at random; here none is left out.
"""

from copy import copy

import numpy as np
import pytest

from _laws import CARRIED, JIT, Condition, batch, survives_the_model_file
from backdrive.errors import InvalidInput
from backdrive.laws import ELEMENTS, RATES, Elastoplastic, Law, LuGre, Rigid
from backdrive.laws.examples import ELEMENT_EXAMPLES, RATE_EXAMPLES
from test_laws_elements import PROPERTIES

MOTIONS = 10 if JIT else 1
PAIRS = [(rate, element) for rate in CARRIED for element in ELEMENTS]


@pytest.mark.parametrize(("rate", "element"), PAIRS, ids=["+".join(pair) for pair in PAIRS])
def test_every_pair(rate, element):
    law = Law(rate=RATE_EXAMPLES[rate], element=ELEMENT_EXAMPLES[element])
    random = np.random.default_rng(len(law.name))
    conditions = [Condition.drawn([0.65, 0.47, 0.1, *u]) for u in random.random((MOTIONS, 2)).tolist()]
    pair = batch([law] * MOTIONS, conditions, random)
    for property_ in PROPERTIES:
        property_(copy(pair), random)
    survives_the_model_file([law])


@pytest.mark.parametrize("rate", [name for name in RATES if RATES[name].SMOOTH])
@pytest.mark.parametrize("element", [name for name in ELEMENTS if ELEMENTS[name] is not Rigid])
def test_a_smooth_rate_law_cannot_be_carried(rate, element):
    with pytest.raises(InvalidInput, match="continuous and zero at rest"):
        Law(rate=RATE_EXAMPLES[rate], element=ELEMENT_EXAMPLES[element])


def test_every_element_says_where_it_may_create_energy():
    """Advice on the examples' Stribeck curve: `gms` and `bliman-sorine` always, those with sigma_1 beyond their bound."""
    curve = RATE_EXAMPLES["stribeck-gauss"]
    assert {name for name, e in ELEMENT_EXAMPLES.items() if e.advice(curve)} == {"gms", "bliman-sorine"}
    for element in (LuGre, Elastoplastic):
        constant = element(stiffness=1e4, damping=20.0)
        assert "viscous >= 10 " in constant.advice(curve)
        assert element(stiffness=1e4, damping=2.0).advice(curve) == ""
        assert constant.advice(RATE_EXAMPLES["coulomb-viscous"]) == ""
        assert "fading" in constant.advice(RATE_EXAMPLES["m4"], load=(10.0, 0.0))
