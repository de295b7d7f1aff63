"""Tests for _assembly.py: an assembled kernel gives the bits of the general one, and the disk remembers it."""

import os
import subprocess
import sys

import numpy as np
import pytest

from _kinds import of_a_kind
from backdrive._assembly import assemble
from backdrive._jit import COMPILED, choice, jit, ladder
from backdrive.control import BareLoop, JointLoop, assembly, joint_loop, loop_kernel
from backdrive.control.compensators import compensator as compensator_
from backdrive.control.compensators.catalog import alg_fc2
from backdrive.control.estimators import external as external_
from backdrive.control.estimators.external import ExternalForce
from backdrive.control.table import ANCHOR, STILL, TORQUE
from backdrive.laws import ELEMENTS, RATES, Decaying, Law, LuGre, Polyline, StribeckGauss, kernels

BRISTLE = LuGre(stiffness=1e4, damping=30.0)
SPRING = Decaying(stiffness=1e4, decay_rate=20.0)


def law_of(name: str) -> Law:
    if name in RATES:
        return Law(rate=RATES[name](**RATES[name].EXAMPLE), element=BRISTLE)
    return Law(rate=StribeckGauss(**StribeckGauss.EXAMPLE), element=ELEMENTS[name](**ELEMENTS[name].EXAMPLE))


def along(step, rate: int, element: int, law: Law) -> np.ndarray:
    p, x = law.row(), law.state()
    increments = 1e-4 * np.random.default_rng(1).standard_normal(300).cumsum()
    return np.array([step(rate, element, p, x, dp, 1e-3, (0.0, 0.0), 20.0) for dp in increments.tolist()])


@pytest.mark.parametrize("name", of_a_kind([*RATES, *ELEMENTS]))
def test_a_step_of_one_law_gives_the_ladders_bits(name):
    law = law_of(name)
    kinds = law.rate.KIND, law.element.KIND
    known = kernels.of_kinds(kernels.step, *kinds)
    assert np.array_equal(along(known, *kinds, law), along(kernels.step, *kinds, law))


def test_a_step_of_two_laws_chooses_between_them():
    laws = law_of("lugre"), law_of("decaying")
    kinds = [law.element.KIND for law in laws]
    both = kernels.of_kinds(kernels.step, laws[0].rate.KIND, kinds)
    for law in laws:
        rate, element = law.rate.KIND, law.element.KIND
        assert np.array_equal(along(both, rate, element, law), along(kernels.step, rate, element, law))


def loop_along(external: str | None, hold: float) -> np.ndarray:
    """Return the tables of a loop that knows its two joints, tick by tick."""
    rate = Polyline(**Polyline.EXAMPLE)
    made = alg_fc2(rate, 1e4, 1e-3)
    estimator = external and ExternalForce(inertia=0.5, friction=made.friction, method=external)
    joints = [BareLoop(compensator=made, external=estimator, limit=5.0, hold=hold)] * 2
    position = 1e-3 * np.random.default_rng(2).standard_normal((200, 2)).cumsum(axis=0)
    *parts, table = joint_loop.rows(joints, np.zeros(2), 1e-3)
    arrays, seen = (*joint_loop.concatenate(parts), table, np.zeros(2, dtype=np.int64)), []
    kernel = assembly.of_loop(loop_kernel.tick, joint_loop.rows(joints, np.zeros(2), 1e-3))
    for q in position:
        kernel(*arrays, q, 1e-3)
        if hold == np.inf:  # for how long a joint stands, and where, is not counted then
            table[:, [STILL, ANCHOR]] = 0.0
        seen.append(table[:, TORQUE:].copy())
    return np.array(seen)


def loop_with_rest(own: float) -> np.ndarray:
    """Return the tables of a loop whose estimator has a share of the compensator's stiffness, tick by tick."""
    count, at_rest, T = 1e-5, 300, 1e-3
    made = alg_fc2(Polyline(**Polyline.EXAMPLE), 1e4, 1e-3)
    friction = alg_fc2(Polyline(**Polyline.EXAMPLE), own * 1e4, 1e-3).friction
    joint = JointLoop(
        compensator=made,
        external=ExternalForce(inertia=0.5, friction=friction, method="momentum"),
        limit=5.0,
        top_speed=10.0,
        encoder_count=count,
        hold=HOLD,
    )
    stroke = 0.2 * np.sin(np.arange(400) * 0.02)
    way = np.concatenate([stroke, np.full(at_rest, stroke[-1]), stroke[-1] + 1e-4 * np.arange(30), stroke])
    rows = joint_loop.rows([joint], np.zeros(1), T)
    assert assembly.shares_friction(rows) == (own == 1.0)
    *parts, table = joint_loop.rows([joint], np.zeros(1), T)
    arrays, seen = (*joint_loop.concatenate(parts), table, np.zeros(1, dtype=np.int64)), []
    kernel = assembly.of_loop(loop_kernel.tick, rows)
    for q in (count * np.round(way / count)).tolist():
        kernel(*arrays, np.array([q]), T)
        seen.append(table.copy())
    return np.array(seen)


HOLD = 0.1  # of `loop_with_rest` [s]
CASES = {
    f"{made.__name__}{given}": (made, given)
    for made, given in [(loop_along, (e, h)) for e in (None, "momentum") for h in (0.05, np.inf)]
    + [(loop_with_rest, (own,)) for own in (1.0, 0.5)]
}


@pytest.fixture(scope="module")
def general(tmp_path_factory) -> dict[str, np.ndarray]:
    """Return what the general kernel gives in each case; it is what runs where nothing is compiled."""
    path = tmp_path_factory.mktemp("general") / "cases.npz"
    script = "import sys, numpy, test_assembly as t; numpy.savez(sys.argv[1], **{k: f(*a) for k, (f, a) in t.CASES.items()})"
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    folder = os.path.dirname(__file__)
    subprocess.run([sys.executable, "-c", script, str(path)], env=environment, cwd=folder, check=True)
    with np.load(path) as arrays:
        return dict(arrays)


@pytest.mark.skipif(not COMPILED, reason="the general kernel is returned")
@pytest.mark.parametrize("name", CASES)
def test_a_loop_that_knows_its_joints_gives_the_bits_of_the_general_one(name, general):
    made, given = CASES[name]
    expected, got = general[name], made(*given)
    assert expected.tobytes() == got.tobytes()
    if made is loop_with_rest:  # compensator and estimator share friction, or do not
        assert np.abs(expected[:, 0, TORQUE]).max() > 0.5
        # the compensator's contact was let go, the estimator's was not
        assert (expected[:, 0, STILL] > HOLD).any()


def test_what_leads_to_no_part_stays_as_it_is():
    parts = kernels.parts([StribeckGauss.KIND], [LuGre.KIND])
    assert assemble(compensator_.shift, parts) is compensator_.shift
    assert assemble(external_.restart, parts) is external_.restart


@pytest.mark.skipif(not COMPILED, reason="the general kernel is returned")
def test_a_part_is_put_in_through_what_is_called():
    def twice(x):
        return 2.0 * x

    def thrice(x):
        return 3.0 * x

    which = choice({2: jit(twice), 3: jit(thrice)}, jit(twice))
    globals()["WHICH"], globals()["inner"] = which, ladder(_inner)
    outer = jit(_outer)
    assert outer(2, 1.0) == 3.0
    assert outer(3, 1.0) == 4.0
    assert assemble(outer, {which: 3})(2, 1.0) == 4.0
    assert assemble(outer, {which: (2, 3)})(2, 1.0) == 3.0
    assert assemble(outer, {(__name__, "ONE"): 10.0})(2, 1.0) == 12.0


ONE = 1.0


def _inner(number, x):
    return WHICH(number, (x,))  # noqa: F821  (a test puts it there)


def _outer(number, x):
    return inner(number, x) + ONE  # noqa: F821  (a test puts it there)


SCRIPT = """
from backdrive._assembly import _made
from backdrive.control import JointLoop, Loop
from backdrive.control.compensators.catalog import alg_fc
from backdrive.laws import Coulomb
Loop(JointLoop(compensator=alg_fc(Coulomb(coulomb=2.0), 1e3), limit=3.0, top_speed=5.0, encoder_count=1e-5), interval=1e-3)
stats = [kernel.stats for kernel in _made.values() if hasattr(kernel, "stats")]
print(sum(sum(s.cache_hits.values()) for s in stats), sum(sum(s.cache_misses.values()) for s in stats))
"""


@pytest.mark.skipif(not COMPILED, reason="nothing is compiled")
def test_another_process_compiles_nothing(tmp_path):
    def run() -> list[int]:
        environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
        done = subprocess.run(
            [sys.executable, "-c", SCRIPT], env=environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        return [int(word) for word in done.stdout.split()]

    hits, misses = run()
    assert hits == 0
    assert misses > 0
    hits, misses = run()
    assert hits > 0
    assert misses == 0
