"""Examples beside a header: an interrupt routine, and the `update()` of a controller in the manner of ros2_control."""

from __future__ import annotations


def interrupt(prefix: str, interval: float, single: bool, joints: int, mark: str) -> str:
    """Return an interrupt routine that runs the loop.

    Args:
        prefix: of the C header.
        interval: period [s].
        single: reals are floats.
        joints: how many.
        mark: of files of ours.
    """
    real, zero = ("float", "0.0f") if single else ("double", "0.0")
    P = prefix.upper()
    hertz = 1.0 / interval
    return f"""\
/* {mark}: example of an interrupt routine that runs the loop at {hertz:g} Hz. Compile with -ffp-contract=off for the same bits. */
#include "{prefix}.h"

/* To be written for the board. */
extern double read_encoder(int joint);                  /* [rad or m] */
extern void command_torque(int joint, {real} torque);   /* [N.m or N] */

static {prefix}_state loop;
static {real} applied[{P}_JOINTS]; /* what was commanded the tick before */

/* Call once, before the interrupts begin; enable the motors only where it returns 0 or 1. */
int setup(void);
int setup(void) {{
  int passed = {prefix}_selftest();
  {prefix}_init(&loop);
  for (int j = 0; j < {P}_JOINTS; j++) applied[j] = {zero};
  return passed;
}}

void timer_interrupt(void);
void timer_interrupt(void) {{
  double position[{P}_JOINTS];
  for (int j = 0; j < {P}_JOINTS; j++) position[j] = read_encoder(j);
  {prefix}_step(&loop, position, applied, {interval!r});
  for (int j = 0; j < {P}_JOINTS; j++) {{
    applied[j] = loop.joint[j].torque; /* add gravity and the controller's torque here */
    command_torque(j, applied[j]);
  }}
}}
"""


def controller(prefix: str, single: bool, mark: str) -> str:
    """Return a class with the `update()` of a controller.

    Args:
        prefix: of the C header.
        single: reals are floats.
        mark: of files of ours.
    """
    real = "float" if single else "double"
    P = prefix.upper()
    return f"""\
// {mark}: example in the manner of a ros2_control controller: interfaces in, interfaces out, nothing allocated in update().
#include <cstddef>
#include <utility>
#include <vector>

#include "{prefix}.hpp"

enum class return_type {{ OK, ERROR }};

class Controller {{
 public:
  // pointers to the state and command interfaces of each joint: position [rad or m], effort in and out [N.m or N]
  Controller(std::vector<const double *> position, std::vector<const double *> measured, std::vector<double *> command)
      : position_(std::move(position)), measured_(std::move(measured)), command_(std::move(command)) {{}}

  return_type on_activate() {{
    if ({prefix}_selftest() < 0 || position_.size() != {P}_JOINTS || measured_.size() != {P}_JOINTS ||
        command_.size() != {P}_JOINTS) {{
      return return_type::ERROR;
    }}
    loop_ = {prefix}::Loop();
    return return_type::OK;
  }}

  return_type update(double period) {{
    std::array<double, {P}_JOINTS> q;
    std::array<{real}, {P}_JOINTS> u;
    for (std::size_t j = 0; j < {P}_JOINTS; j++) {{
      q[j] = *position_[j];
      u[j] = static_cast<{real}>(*measured_[j]);
    }}
    const int worst = loop_.step(q, u, period);
    for (std::size_t j = 0; j < {P}_JOINTS; j++) *command_[j] = loop_.torque(static_cast<int>(j));
    return worst == {P}_LATCHED ? return_type::ERROR : return_type::OK;
  }}

 private:
  std::vector<const double *> position_, measured_;
  std::vector<double *> command_;
  {prefix}::Loop loop_;
}};
"""
