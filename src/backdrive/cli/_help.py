"""Help as plain text of 80 columns: options by panel, commands with a whole sentence each."""

from __future__ import annotations

import re
from typing import Any

from typer.core import TyperCommand

LIST = re.compile(r"<list\[(\w+)\]>")

#: Command -> what it does, in a line of the list of commands.
LINES = {
    "demo": "Simulate a joint, identify it, and let a hand move it.",
    "inspect": "Show what a log contains, and its faults.",
    "plan": "Plan a motion for identification, within limits.",
    "identify": "Identify the friction of every joint of a log.",
    "show": "Show a friction model and its curve.",
    "validate": "Compare measured with predicted torque.",
    "compare": "Compare two models: what has changed?",
    "estimate": "Estimate external torque without a force sensor.",
    "tune": "Choose a compensator's numbers, with margins.",
    "export": "Write the tuned loop as C, or numbers for simulators.",
    "laws": "List the friction laws, or show one.",
    "reproduce": "Run the thesis' experiments in simulation.",
    "run": "Identify every log of a folder or bucket.",
    "status": "Show what is done and what failed.",
    "trend": "Show a joint's friction over the days.",
    "drifted": "Name the joints whose friction has changed.",
    "sql": "Query the results in SQL.",
    "page": "Write one page on the whole fleet.",
    "merge": "Merge robots of a type into a mean robot.",
    "rename": "Give a robot another name in the results.",
    "forget": "Remove a robot from the results.",
    "simulate": "Write logs of a simulated fleet.",
}


def _single(found: re.Match[str]) -> str:
    return f"<{found[1].lower()}>"


class PlainCommand(TyperCommand):
    """A command whose help lists its options by `rich_help_panel`, in the order of first use."""

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write arguments, then each panel of options."""
        panels: dict[str, list[tuple[str, str]]] = {}
        for parameter in self.get_params(ctx):
            record = parameter.get_help_record(ctx)
            if record is None:
                continue
            usual = "Arguments" if parameter.param_type_name == "argument" else "Options"
            names, text = record  # an option that may be repeated takes one value each time
            panel = getattr(parameter, "rich_help_panel", None) or usual
            panels.setdefault(panel, []).append((LIST.sub(_single, names), text))
        for name in sorted(panels, key=lambda name: name != "Arguments"):
            with formatter.section(name):
                formatter.write_dl(panels[name])
