"""The output of `backdrive estimate` on a terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from backdrive.cli._output import console as new_console
from backdrive.cli._output import print_lines, table

if TYPE_CHECKING:
    from backdrive.external import ForceEstimate
    from backdrive.external.wrench import WrenchEstimate

MOST = 20  # contacts that a terminal lists


def print_result(result: ForceEstimate, remarks: list[str]) -> None:
    """Print a line a joint, a line a contact, and the remarks."""
    from backdrive.external.figures import joint_figures

    console = new_console()
    known = any(j.known is not None for j in result.joints)
    headings = ["joint", "method", "bandwidth", "rms", "largest", "at", "acted on"]
    rows = table(*headings, *(["error, rms"] if known else []), text=("joint", "method"))
    for one in result.joints:
        f, unit = joint_figures(one), one.joint.torque_unit
        cells = [
            one.joint.name,
            one.method,
            f"{one.bandwidth:.3g} 1/s",
            f"{f['rms']:.3g} {unit}",
            f"{f['largest']:.3g} {unit}",
            f"{f['time_of_largest']:.4g} s",
            f"{100 * f['share_outside_band']:.0f} % of the time",
        ]
        rows.add_row(
            *cells, *([f"{one.rms_error:.3g} {unit}" if one.rms_error is not None else ""] if known else [])
        )
    console.print(rows)
    if result.wrench is not None:
        _print_wrench(console, result.wrench)
    if result.contacts is not None:
        _print_contacts(console, result)
    print_lines(console, remarks, style="yellow")


def _print_wrench(console: Any, wrench: WrenchEstimate) -> None:
    from backdrive.external.figures import wrench_figures

    f = wrench_figures(wrench)
    console.print(f"\nwrench at {wrench.frame}, along the axes of the base")
    error = f["rms_error"]
    rows = table(
        "component",
        "rms",
        "largest",
        "standard deviation",
        *(["error, rms"] if error else []),
        text=("component",),
    )
    for i, name in enumerate(f["components"]):
        unit = "N" if i < 3 else "N.m"
        cells = [f"{f[key][i]:.3g} {unit}" for key in ("rms", "largest", "standard_deviation")]
        rows.add_row(name, *cells, *([f"{error[i]:.3g} {unit}"] if error else []))
    console.print(rows)


def _print_contacts(console: Any, result: ForceEstimate) -> None:
    contacts, units = result.contacts or (), {j.joint.name: j.joint.torque_unit for j in result.joints}
    count = "no contact" if not contacts else f"{len(contacts)} contact{'s' * (len(contacts) > 1)}"
    console.print(
        f"\n{count}, at thresholds for a false-alarm rate of {result.false_alarms:g}/h over all joints"
    )
    if contacts:
        rows = table("begin", "end", "joint", "largest", text=("joint",))
        for c in contacts[:MOST]:
            largest = "  ".join(f"{f:+.3g} {units[name]}" for name, f in c.forces.items())
            rows.add_row(f"{c.begin:.3f} s", f"{c.end:.3f} s", ", ".join(c.joints), largest)
        console.print(rows)
        if len(contacts) > MOST:
            console.print(f"and {len(contacts) - MOST} more (--json lists all)")
