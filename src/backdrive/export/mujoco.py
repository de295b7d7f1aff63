"""Any friction law in MuJoCo, in C: a passive-force callback around the generated header, and an MJCF file prepared for it.

As `MujocoFriction` in Python, the callback computes the torque once per step, from the displacement since the previous one, and
holds it. Its state is in `mjData.userdata`, so copies, threads and resets of a simulation are independent.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

from backdrive._files import read_whole
from backdrive.errors import InvalidInput, ReadError, require
from backdrive.export import c
from backdrive.export.loop_header import frame_header
from backdrive.export.parts import PartsHeader, of_law
from backdrive.export.simulators import MAX_BYTES, joints_of, relocate
from backdrive.laws import REFERENCE
from backdrive.robot.xml import parse
from backdrive.simulation.mujoco_friction import PURPOSE, Dof, dofs

if TYPE_CHECKING:
    from backdrive.model import FrictionModel

HEAD = 2  # numbers in userdata before those of the joints: a mark of this callback, and the time of the last torque
EACH = 4  # of each joint, beside the state of its law: places in qpos and qvel, position before, torque


def export_mujoco(
    model: FrictionModel,
    robot: str | Path,
    folder: str | Path,
    *,
    joints: Sequence[str] | None = None,
    name: str = "friction",
    temperature: float = REFERENCE,
    source: str = "",
) -> tuple[list[Path], list[Dof], float]:
    """Write laws as C, a callback for MuJoCo, and the MJCF file prepared for it.

    Args:
        model: of friction; joints are matched by name.
        robot: MJCF file.
        folder: folder to write to, created if absent.
        joints: names; None: all of the model.
        name: of header and callback, and the beginning of every name in them.
        temperature: of the joints [degC].
        source: where the numbers come from, for the comment.

    Returns:
        Files written (header, callback, MJCF); the joints with their laws; the time step written into the MJCF [s].

    Raises:
        InvalidInput: a joint is not there, or too stiff for the step of the MJCF.
        ReadError: the description cannot be read.
        WriteError: a file is there that is not ours.
        MissingExtra: MuJoCo is not installed.
    """
    mujoco = require("mujoco", PURPOSE, "sim")
    robot, folder = Path(robot), Path(folder)
    data = read_whole(robot, MAX_BYTES, error=ReadError, remedy="Name an MJCF file.")
    root = parse(data, str(robot))
    if root.tag != "mujoco":
        raise ReadError(f"{robot} begins with <{root.tag}>.", remedy="Name an MJCF (<mujoco>) file.")
    try:
        simulated = mujoco.MjModel.from_xml_path(str(robot))
    except ValueError as error:
        raise ReadError(f"MuJoCo cannot load {robot}: {error}.", remedy="Mend the description.") from error
    if simulated.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4:
        raise InvalidInput(
            f"{robot} is integrated by RK4, which tries a step several times.",
            remedy='Set integrator="implicitfast" in its <option>.',
        )
    simulated.dof_frictionloss[:] = 0.0
    placed = dofs(model, simulated, joints)
    step = float(simulated.opt.timestep) / max(d.steps for d in placed)
    prefix = c.identifier(name)
    names = c.identifiers([d.name for d in placed])
    parts = {n: of_law(d.law) for n, d in zip(names, placed, strict=False)}
    sizes = [sum(state.size for state in part.states.values()) for part in parts.values()]
    numbers = HEAD + EACH * len(placed) + sum(sizes)
    _prepare(root, model, placed, numbers, step)
    relocate(root, robot.parent, folder)
    content = repr([d.law for d in placed]) + repr(temperature)
    title = f"Friction of {', '.join(d.name for d in placed)} in MuJoCo."
    header = frame_header(
        prefix, c.comment(title, source, content, ""), PartsHeader(parts, prefix, False).text()
    )
    files = {
        f"{prefix}.h": header,
        f"{prefix}_mujoco.c": callback(
            prefix,
            dict(zip(names, placed, strict=False)),
            numbers,
            temperature,
            c.comment(title, source, content, ""),
        ),
        robot.name: f'<?xml version="1.0"?>\n<!-- {c.MARK}: {robot.name} for the friction of {prefix}_mujoco.c -->\n'
        f"{ElementTree.tostring(root, encoding='unicode')}\n",
    }
    return c.write_all(folder, files), placed, step


def _prepare(root: Any, model: FrictionModel, placed: Sequence[Dof], numbers: int, step: float) -> None:
    """Reserve memory for the callback's state, and remove MuJoCo's own friction from the joints."""
    for tag, key, value in (("size", "nuserdata", str(numbers)), ("option", "timestep", repr(step))):
        nodes = root.findall(tag)
        node = nodes[-1] if nodes else ElementTree.SubElement(root, tag)
        if key == "nuserdata":
            value = str(max(numbers, int(node.get(key, "0"))))
        node.set(key, value)
    nodes = joints_of(root)
    for dof in placed:
        node, actuator = nodes[dof.name], model.joint(dof.name).actuator
        node.set("frictionloss", "0")
        node.set("damping", "0")
        if actuator is not None and actuator.motor_inertia is not None:
            node.set("armature", repr(actuator.motor_inertia))


def callback(prefix: str, joints: dict[str, Dof], numbers: int, temperature: float, comment: str) -> str:
    """Return the C file of the callback.

    Args:
        prefix: of every name.
        joints: name in C -> joint.
        numbers: of `mjData.userdata` that it needs.
        temperature: of the joints [degC].
        comment: of the file.
    """
    P, J = prefix.upper(), len(joints)
    states = "".join(f"  {prefix}_{n}_state {n};\n" for n in joints)
    quoted = ", ".join('"' + d.name.replace("\\", "\\\\").replace('"', '\\"') + '"' for d in joints.values())
    resets = "".join(f"  {prefix}_{n}_reset(&s->{n}, s->before[{j}]);\n" for j, n in enumerate(joints))
    steps = "".join(
        f"    s->torque[{j}] = {prefix}_{n}_step(&s->{n}, dp[{j}], dt, motor[{j}], other[{j}], {temperature!r});\n"
        for j, n in enumerate(joints)
    )
    return f"""\
/* {comment}

   mjcb_passive = {prefix}_passive;          in C, after {prefix}_check(m) gave NULL
   cc -O2 -shared -fPIC -ffp-contract=off {prefix}_mujoco.c -I MUJOCO/include -o lib{prefix}.so

   In Python: kind, library = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p), ctypes.CDLL("./lib{prefix}.so")
              mujoco.set_mjcb_passive(kind(("{prefix}_passive", library))) */
#include <mujoco/mujoco.h>
#include <stddef.h>
#include <string.h>
#include "{prefix}.h"

#ifndef {P}_USERDATA
#define {P}_USERDATA 0 /* where its numbers begin in mjData.userdata */
#endif
#define {P}_NUMBERS {numbers}
#define {P}_OURS {_magic(comment)} /* stands first in userdata once they are ours */

/* In mjData.userdata: each simulation has its own. */
typedef struct {{
  double ours, time;
  double q[{J}], v[{J}], before[{J}], torque[{J}];
{states}}} {prefix}_memory;

typedef char {prefix}_fits[sizeof({prefix}_memory) <= {P}_NUMBERS * sizeof(mjtNum) ? 1 : -1];

static const char *const {prefix}_joints[{J}] = {{{quoted}}};

#ifdef __cplusplus
extern "C" {{
#endif
#if defined(_WIN32)
#define {P}_API __declspec(dllexport)
#else
#define {P}_API
#endif
{P}_API const char *{prefix}_check(const mjModel *m);
{P}_API void {prefix}_passive(const mjModel *m, mjData *d);

/* Return the number of a joint, or -1. */
static int {prefix}_find(const mjModel *m, const char *name) {{
  for (int i = 0; i < m->njnt; i++) {{
    if (strcmp(m->names + m->name_jntadr[i], name) == 0) return i;
  }}
  return -1;
}}

/* Return what is wrong with a model, or NULL. */
const char *{prefix}_check(const mjModel *m) {{
  if (m->nuserdata < {P}_USERDATA + {P}_NUMBERS) return "nuserdata is too small for the friction";
  if (m->opt.integrator == mjINT_RK4) return "RK4 tries a step several times: use another integrator";
  for (int j = 0; j < {J}; j++) {{
    int i = {prefix}_find(m, {prefix}_joints[j]);
    if (i < 0) return {prefix}_joints[j];
    if (m->dof_frictionloss[m->jnt_dofadr[i]] > 0.0) return "a joint has frictionloss beside its law";
  }}
  return NULL;
}}

/* Begin at rest, relaxed; return whether the model has the joints. */
static int {prefix}_begin(const mjModel *m, const mjData *d, {prefix}_memory *s) {{
  for (int j = 0; j < {J}; j++) {{
    int i = {prefix}_find(m, {prefix}_joints[j]);
    if (i < 0) return 0;
    s->q[j] = m->jnt_qposadr[i];
    s->v[j] = m->jnt_dofadr[i];
    s->before[j] = d->qpos[m->jnt_qposadr[i]];
    s->torque[j] = 0.0;
  }}
{resets}  s->ours = {P}_OURS;
  s->time = d->time;
  return 1;
}}

/* Add the friction to qfrc_passive; a model without these joints or without room is left alone. */
void {prefix}_passive(const mjModel *m, mjData *d) {{
  if (m->nuserdata < {P}_USERDATA + {P}_NUMBERS) return;
  {prefix}_memory *s = ({prefix}_memory *)(void *)(d->userdata + {P}_USERDATA);
  if ((s->ours < {P}_OURS || s->ours > {P}_OURS || d->time < s->time) && !{prefix}_begin(m, d, s)) return;
  double dt = d->time - s->time;
  if (dt > 0.0) {{
    double dp[{J}], motor[{J}], other[{J}];
    for (int j = 0; j < {J}; j++) {{
      int v = (int)s->v[j];
      double q = d->qpos[(int)s->q[j]];
      dp[j] = q - s->before[j];
      motor[j] = d->qfrc_actuator[v];
      other[j] = d->qfrc_smooth[v] + d->qfrc_constraint[v] + s->torque[j] - motor[j];
      s->before[j] = q;
    }}
    s->time = d->time;
{steps}  }}
  for (int j = 0; j < {J}; j++) d->qfrc_passive[(int)s->v[j]] -= s->torque[j];
}}
#ifdef __cplusplus
}}
#endif
"""


def _magic(comment: str) -> str:
    """Return a number that identifies these files."""
    import hashlib

    return f"{int(hashlib.sha256(comment.encode()).hexdigest()[:12], 16)}.0"
