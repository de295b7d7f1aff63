"""A C++17 class around the loop of a C header."""

from __future__ import annotations

from collections.abc import Sequence


def wrapper(prefix: str, names: Sequence[str], single: bool, comment: str) -> str:
    """Return the header of the class.

    Args:
        prefix: of the C header.
        names: of the joints.
        single: reals are floats.
        comment: first lines.
    """
    real = "float" if single else "double"
    P = prefix.upper()
    joints = ", ".join(f'"{n}"' for n in names)
    lines = "\n".join(f" * {line}".rstrip() for line in comment.splitlines())
    return f"""\
/*
{lines}
 */
#ifndef {P}_HPP
#define {P}_HPP

#include <array>
#include <string_view>

#include "{prefix}.h"

namespace {prefix} {{

/* A torque loop that keeps its own state; copies are loops of their own in the same state. */
class Loop {{
 public:
  static constexpr int joints = {P}_JOINTS;
  static constexpr std::array<std::string_view, {P}_JOINTS> names = {{{joints}}};

  Loop() noexcept {{ {prefix}_init(&state_); }}

  /* Joints rest at these positions [rad or m], without torque. */
  void reset(const std::array<double, {P}_JOINTS> &position) noexcept {{ {prefix}_reset(&state_, position.data()); }}

  /* One tick: encoder readings, torque that acted since the tick before, time since then [s]. Returns the worst status. */
  int step(const std::array<double, {P}_JOINTS> &position, const std::array<{real}, {P}_JOINTS> &applied,
           double interval) noexcept {{
    return {prefix}_step(&state_, position.data(), applied.data(), interval);
  }}

  void stop() noexcept {{ {prefix}_stop(&state_); }}
  bool acknowledge() noexcept {{ return {prefix}_acknowledge(&state_) != 0; }}

  {real} torque(int joint) const noexcept {{ return state_.joint[joint].torque; }}
  {real} external(int joint) const noexcept {{ return state_.joint[joint].external; }}
  {real} friction(int joint) const noexcept {{ return state_.joint[joint].friction; }}
  int status(int joint) const noexcept {{ return state_.code[joint]; }}

  /* Gravity and the other joints' pull [N.m or N], for the next tick. */
  void set_known(int joint, {real} torque) noexcept {{ state_.joint[joint].known = torque; }}
  /* Temperature for laws that depend on it [degC]. */
  void set_temperature(int joint, {real} degrees) noexcept {{ state_.joint[joint].temperature = degrees; }}
  /* The state itself, with all inputs and outputs. */
  {prefix}_state &state() noexcept {{ return state_; }}

 private:
  {prefix}_state state_;
}};

}}  // namespace {prefix}

#endif
"""
