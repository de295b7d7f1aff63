"""The defended loop as C: the same bits as in Python through faults, stops and latches; files, names, refusals."""

from __future__ import annotations

import ctypes
import json
import subprocess

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from _c import WARNINGS, ZIG, compiled
from backdrive import load_model
from backdrive.cli import app
from backdrive.control.compensators.catalog import alg_fc2
from backdrive.control.compensators.compensator import Compensator
from backdrive.control.compensators.dither import Dither
from backdrive.control.estimators.external import ExternalForce
from backdrive.control.estimators.friction import FrictionEstimator, alg_fe, alg_fe2, ha
from backdrive.control.estimators.level import Adaptation
from backdrive.control.joint_loop import BareLoop, JointLoop
from backdrive.control.loop import Loop
from backdrive.errors import InvalidInput, WriteError
from backdrive.export import export_laws, export_loop
from backdrive.export.c import identifier, identifiers
from backdrive.export.labels import law_labels
from backdrive.laws import ELEMENTS, Growth, Law, LuGre, Polyline, StribeckGauss

CURVE = Law(
    rate=Polyline(
        velocity=(0.01, 0.1, 0.5, 2.0), positive=(5.0, 4.0, 4.5, 6.0), negative=(4.5, 4.2, 4.4, 5.0)
    )
)
COUNT, PERIOD = 1e-5, 1e-3
LIMITS = dict(top_speed=2.5, limit=4.5, encoder_count=COUNT)
DRIVER = """
#include "arm.h"
static arm_state state;
void set_up(void); void set_up(void) { arm_init(&state); }
void halt(void); void halt(void) { arm_stop(&state); }
void rest(const double *q); void rest(const double *q) { arm_reset(&state, q); }
int again(void); int again(void) { return arm_acknowledge(&state); }
int selftest(void); int selftest(void) { return arm_selftest(); }
int tick(const double *q, const REAL *u, double dt, const REAL *in, double *out);
int tick(const double *q, const REAL *u, double dt, const REAL *in, double *out) {
  int worst;
  for (int j = 0; j < ARM_JOINTS; j++) {
    arm_joint *g = &state.joint[j];
    g->error = in[3 * j];
    g->known = in[3 * j + 1];
    g->load = in[3 * j + 2];
  }
  worst = arm_step(&state, q, u, dt);
  for (int j = 0; j < ARM_JOINTS; j++) {
    arm_joint *g = &state.joint[j];
    out[6 * j] = (double)g->torque;
    out[6 * j + 1] = (double)g->external;
    out[6 * j + 2] = (double)g->friction;
    out[6 * j + 3] = (double)g->level;
    out[6 * j + 4] = (double)g->cause;
    out[6 * j + 5] = (double)state.code[j];
  }
  return worst;
}
"""


def joints() -> dict[str, JointLoop]:
    lugre = FrictionEstimator(
        law=Law(rate=StribeckGauss(**StribeckGauss.EXAMPLE), element=LuGre(**LuGre.EXAMPLE))
    )
    adaptive = Dither(share=0.2, frequency=23.0, mode="adaptive", count=COUNT)
    kalman = ExternalForce(inertia=0.5, friction=alg_fe(CURVE, 8e3), method="kalman", bandwidth=40.0)
    switching = ExternalForce(inertia=0.5, friction=alg_fe2(CURVE, 8e3, 0.0155), method="momentum")
    direct = ExternalForce(
        inertia=0.5, friction=ha(CURVE, 8e3), method="direct", gravity_sin=2.0, gravity_cos=0.3
    )
    fc2 = alg_fc2(CURVE, 8e3, 0.0155, 20.0, 500.0, 10.0, None, 0.8)
    return {
        "shoulder pan": JointLoop(compensator=fc2, external=kalman, **LIMITS),
        "elbow": JointLoop(compensator=fc2, **LIMITS),
        "wrist-1": JointLoop(
            compensator=Compensator(friction=alg_fe(CURVE, 8e3), share=0.7, dither=adaptive),
            external=switching,
            adaptation=Adaptation(slowest=0.02, upper=1.1),
            **LIMITS,
        ),
        "2nd": JointLoop(compensator=Compensator(friction=lugre, share=0.7), external=direct, **LIMITS),
    }


def inputs(n: int, J: int) -> tuple[np.ndarray, ...]:
    """Readings with wild ones, a joint that runs away, and ticks that come late or not at all."""
    random = np.random.default_rng(7)
    t = PERIOD * np.arange(n)
    q = 0.3 * np.sin(4.4 * t)[:, None] * np.linspace(0.2, 1.0, J) + 0.05 * np.sin(9.0 * t)[:, None]
    q[n // 2 : n // 2 + 700] = q[n // 2]  # rests longer than the hold time
    q[5 * n // 6 :, 0] += 4.1 * (t[5 * n // 6 :] - t[5 * n // 6])
    q = np.round(q / COUNT) * COUNT
    u, wild, dt = random.normal(size=(n, J)), random.random((n, J)), np.full(n, PERIOD)
    q[wild < 0.001] = np.nan
    q[(wild > 0.001) & (wild < 0.002)] += 0.98765
    u[wild > 0.9995] = np.inf
    dt[random.random(n) < 0.01] *= 1.7
    dt[random.random(n) < 0.002] = -1.0
    more = np.stack([1e-3 * np.sin(t), 0.5 * np.sin(5.0 * t), random.normal(size=n)], axis=1)
    return q, u, dt, np.repeat(more[:, None, :], J, axis=1)


@pytest.mark.parametrize("precision", ["double", "float"])
def test_the_loop_gives_what_it_gives_here(tmp_path, precision):
    loops = joints()
    export_loop(loops, PERIOD, tmp_path, name="arm", precision=precision)
    real, kind = ("float", np.float32) if precision == "float" else ("double", np.float64)
    library = ctypes.CDLL(str(compiled(tmp_path, DRIVER.replace("REAL", real))))
    library.tick.argtypes = [
        ctypes.c_void_p,
        ctypes.c_void_p,
        ctypes.c_double,
        ctypes.c_void_p,
        ctypes.c_void_p,
    ]
    library.rest.argtypes = [ctypes.c_void_p]
    assert library.selftest() == (1 if precision == "float" else 0)
    n, J = 6000, len(loops)
    q, u, dt, more = inputs(n, J)
    here, out = Loop(list(loops.values()), interval=PERIOD), np.empty((J, 6))
    library.set_up()
    worst_difference, codes = 0.0, set()
    for k in range(n):
        a, b = u[k].astype(kind), np.ascontiguousarray(more[k].astype(kind))
        worst = library.tick(q[k].ctypes.data, a.ctypes.data, float(dt[k]), b.ctypes.data, out.ctypes.data)
        here.error, here.known = b[:, 0], b[:, 1]
        here.load[:, 1] = b[:, 2]
        assert worst == here.update(q[k], a.astype(float), float(dt[k]))
        causes = [int(c) for c in here.causes]
        expected = np.column_stack(
            [here.torque, here.external, here.friction, here.level, causes, here.codes]
        )
        assert np.array_equal(out[:, 4:], expected[:, 4:])
        codes |= set(here.codes.tolist())
        if precision == "double":
            assert np.array_equal(out, expected), k
        else:
            worst_difference = max(worst_difference, np.abs(out[:, 0] - expected[:, 0]).max())
        if k == n // 4:  # what follows is compared from the next tick on
            library.halt()
            here.stop()
        if k in (n // 4 + 300, n - 200):
            assert bool(library.again()) == here.acknowledge()
        if k == n - 100:
            library.rest(np.zeros(J).ctypes.data)
            here.reset(np.zeros(J))
    assert worst_difference <= 1e-5 * LIMITS["limit"]
    assert codes >= {0, 1, 2, 4, 5, 6, 7, 8, 9}


def test_examples_and_wrapper_compile_and_nothing_clashes(tmp_path):
    export_loop(joints(), PERIOD, tmp_path, name="arm")
    export_laws({"a": CURVE}, tmp_path, name="laws")
    (tmp_path / "other.c").write_text(
        '#include "arm.h"\n#include "laws.h"\nint other(void);\nint other(void) { return arm_selftest(); }\n'
    )
    main = '#include "arm.hpp"\nextern "C" int other(void);\nint main() {\n  arm::Loop loop;\n  loop.step({}, {}, 1e-3);\n'
    (tmp_path / "main.cpp").write_text(
        main + "  return arm_selftest() + other() + (loop.torque(0) != 0.0);\n}\n"
    )
    flags = ["-O1", "-ffp-contract=off", *WARNINGS, "-c"]
    for compiler, standard, file in (
        ("cc", "c99", "arm_interrupt.c"),
        ("cc", "c17", "other.c"),
        ("c++", "c++17", "arm_controller.cpp"),
        ("c++", "c++17", "main.cpp"),
    ):
        command = [*ZIG, compiler, f"-std={standard}", *flags, "-o", f"{file}.o", file]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr[:2000]
    fast = subprocess.run(
        [*ZIG, "cc", "-std=c99", "-ffast-math", "-c", "-o", "x.o", "other.c"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert fast.returncode != 0
    assert "-ffast-math" in fast.stderr


@pytest.mark.parametrize("precision", ["double", "float"])
def test_laws_test_themselves_and_name_their_numbers(tmp_path, precision):
    laws = {
        "a b": Law(rate=StribeckGauss(**StribeckGauss.EXAMPLE), element=LuGre(**LuGre.EXAMPLE)),
        "c": CURVE,
    }
    export_laws(laws, tmp_path, name="laws", precision=precision)
    text = (tmp_path / "laws.h").read_text()
    assert "/* stribeck_velocity v_s [rad/s or m/s] */" in text
    test = '#include "laws.h"\nint selftest(void); int selftest(void) { return laws_selftest(); }\n'
    good = ctypes.CDLL(str(compiled(tmp_path, test)))
    assert good.selftest() == (1 if precision == "float" else 0)
    (tmp_path / "laws.h").write_text(text.replace("hi : lo", "lo : hi"))  # a wrong bound of the bristle
    bad = tmp_path / "bad"
    bad.mkdir()
    (bad / "laws.h").write_text((tmp_path / "laws.h").read_text())
    assert ctypes.CDLL(str(compiled(bad, test))).selftest() < 0


def test_labels_follow_the_parameters():
    grown = Law(rate=CURVE.rate, growth=Growth(load_driving=0.1, load_driven=0.05, load_carried=2.0))
    assert sum("load_" in label for label in law_labels(grown)) == 3
    gms = ELEMENTS["gms"]
    labels = law_labels(Law(rate=StribeckGauss(**StribeckGauss.EXAMPLE), element=gms(**gms.EXAMPLE)))
    assert "stiffness k_i, 2 [N.m/rad or N/m]" in labels


def test_the_same_joints_share_their_code(tmp_path):
    joint = joints()["elbow"]
    one = export_loop({"a": joint}, PERIOD, tmp_path / "1")[0].read_text()
    six = export_loop(dict.fromkeys("abcdef", joint), PERIOD, tmp_path / "6")[0].read_text()
    assert (
        six.count("LOOP_INLINE int loop_core_loop_kernel_joint")
        == one.count("LOOP_INLINE int loop_core_loop_kernel_joint")
        == 1
    )
    assert (
        export_loop({"a": joint}, PERIOD, tmp_path / "1")[0].read_text() == one
    )  # ours is replaced, by the same


def test_what_cannot_be_exported_is_refused(tmp_path):
    joint = joints()["elbow"]
    with pytest.raises(InvalidInput, match="no joint"):
        export_loop({}, PERIOD, tmp_path)
    with pytest.raises(InvalidInput, match="no limits"):
        export_loop({"a": BareLoop()}, PERIOD, tmp_path)
    with pytest.raises(InvalidInput, match="interval"):
        export_loop({"a": joint}, 10.0, tmp_path)
    with pytest.raises(InvalidInput, match="half"):
        export_loop({"a": joint}, PERIOD, tmp_path, precision="half")
    with pytest.raises(InvalidInput, match="both"):
        export_loop({"j 1": joint, "j-1": joint}, PERIOD, tmp_path)
    with pytest.raises(InvalidInput, match="No friction law"):
        export_laws({}, tmp_path)
    (tmp_path / "loop.h").write_text("mine")
    with pytest.raises(WriteError, match="was not made by an export"):
        export_loop({"a": joint}, PERIOD, tmp_path)
    assert (tmp_path / "loop.h").read_text() == "mine"
    assert not (tmp_path / "loop.hpp").exists()


@given(st.text(min_size=1))
def test_identifiers_are_what_c_takes(name):
    try:
        plain = identifier(name)
    except InvalidInput:
        return
    assert plain.isidentifier()
    assert plain.isascii()
    assert plain not in ("int", "double", "default", "class", "exp")


def test_keywords_and_digits_are_no_names():
    assert identifiers(["int", "3", "Schulter ä 2"]) == ["int_", "j3", "schulter_2"]


def command(*words: str) -> tuple[int, str]:
    result = CliRunner().invoke(app, ["export", *map(str, words)])
    return result.exit_code, result.output + getattr(result.exception, "text", "")


def test_the_command_exports_laws_and_tells_what_is_wrong(tmp_path):
    code, said = command("preset:mx106/m6", "-o", tmp_path, "--json")
    assert code == 0
    assert json.loads(said)["written"] == [str(tmp_path / "friction.h")]
    assert (
        "From mx106" in (tmp_path / "friction.h").read_text()
        or "From m6" in (tmp_path / "friction.h").read_text()
    )
    assert "--to fortran" in command("preset:mx106/m6", "--to", "fortran")[1]
    assert "no.json" in command("preset:mx106/m6", "--tuning", tmp_path / "no.json", "-o", tmp_path)[1]
    assert "nobody" in command("preset:mx106/m6", "--joint", "nobody")[1]


def test_a_share_beyond_what_the_model_is_sure_of_is_refused():
    from dataclasses import replace

    from backdrive.cli.export import _check_share

    model = load_model("preset:mx106/m6")
    friction = replace(model.joint(model.names[0]), law=Law(rate=StribeckGauss(**StribeckGauss.EXAMPLE)))
    model = replace(model, joints=(friction,))
    unsure = replace(friction, standard_errors={"breakaway": 1.2, "coulomb": 0.1})
    loop, name = joints()["elbow"], model.names[0]
    _check_share(model, name, loop, 0.9)  # the model says nothing of its errors
    with pytest.raises(InvalidInput, match=r"the tuning supports up to R = 0\.7"):
        _check_share(model, name, loop, 0.7)
    with pytest.raises(InvalidInput, match="beyond"):
        _check_share(replace(model, joints=(unsure,)), name, loop, 0.9)
