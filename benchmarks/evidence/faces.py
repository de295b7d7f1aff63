"""The faces: results in a notebook, texts in pictures, commands in 80 columns, pages in a browser.

Every result class is shown by a notebook that nbclient executes: every class that the functions and methods of the API pages
return, less the exceptions that are printed with their reasons; every picture is asked for the boxes of its own texts;
every command's help, and what commands print of a demo's log, is measured; every page is opened in headless Chromium at 390 and
1280 px, light and dark, and its console and network watched. `--plant` plants one fault of each kind, which must be noticed.

    python benchmarks/evidence/faces.py --short
"""

from __future__ import annotations

import os
import pty
import re
import shutil
import subprocess
import sys
import tempfile
import termios
from itertools import product
from pathlib import Path
from typing import Any

from _browser import browser, serve, visit
from _common import Judge, parser
from _faces_pictures import pictures
from _faces_results import EXCEPTIONS, SHOWS, results

ROOT = Path(__file__).parents[2]
COLUMNS, WIDTHS, SCREENS = 80, (390, 1280), (False, True)
CELLS = {
    "Identification": "result",
    "FrictionModel": "result.model",
    "Comparison": "compare(result.model, second.model)",
    "Tuning": "tuning",
    "ForceEstimate": "estimate_force(result.model, log)",
    "Validation": "validate(result.model, log)",
    "Log": "log",
    "Sweep": "plan",
    "ConstantVelocity": "ConstantVelocity(stroke=0.5, speeds=(0.2, 0.4))",
    "Multisine": "Multisine(stroke=0.3, low=0.2, high=1.0, period=5.0)",
    "TorqueRamp": "TorqueRamp(peak=2.0, rate=1.0)",
    "SawtoothTorque": "SawtoothTorque(amplitude=2.0, frequency=0.5)",
    "SineTorque": "SineTorque(amplitude=2.0, frequency=0.5)",
    "InTurn": "InTurn((plan,))",
    "ArmPlan": "ArmPlan(('a', 'b'), ('rad', 'rad'), (0, 0), ((0.1,), (0.1,)), ((0,), (0,)), 10.0, periods=3)",
    "PayloadEstimate": """PayloadEstimate(
        frame="tool", mass=2.0, mass_error=0.1, mass_error_of_data=0.01, center=np.ones(3), center_error=np.ones(3) / 10,
        inertia=None, inertia_error=None, limited_by="gains", lever={"a": 3.0},
        gains=Gains(kind="none", by_joint={}, remarks=()))""",
}
BEGIN = """
import numpy as np
from backdrive import Sweep, compare, identify, simulate, tune
from backdrive.external import PayloadEstimate, estimate_force
from backdrive.external.gains import Gains
from backdrive.identification import validate
from backdrive.plans import ArmPlan, ConstantVelocity, InTurn, Multisine, SawtoothTorque, SineTorque, TorqueRamp
from backdrive.simulation.machines import machine
plan = Sweep(stroke=0.35, top_speed=2.0, cycles=6)
log = simulate(machine("joint_1").replace(torque_noise=1.0), plan, seed=0)
result = identify(log)
second = identify(simulate(machine("joint_1").replace(torque_noise=1.0), plan, seed=1))
tuning = tune(result.model, "joint_1", stiffness=(8e4, 1.2e5), top_speed=3.0, joints=8, draw=True)
"""


def main() -> None:
    """Check the four kinds of face."""
    made = parser(__doc__)
    made.add_argument(
        "--plant", action="store_true", help="plant one fault of each kind: the program must fall short"
    )
    options = made.parse_args()
    program = browser()
    for name, there in (
        ("nbclient", _has("nbclient")),
        ("ipykernel", _has("ipykernel")),
        ("chromium", program),
    ):
        if not there:
            print(f'{name} is absent: pip install ".[bench]", and Chromium by the system')
            sys.exit(2)
    judge = Judge()
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        notebook(judge, place)
        commands(judge, place, options.plant)
        pictures(judge, place, options.short, options.plant)
        pages(judge, place, str(program), options.short, options.plant)
    judge.end()


def _has(module: str) -> bool:
    from importlib.util import find_spec

    return find_spec(module) is not None


def notebook(judge: Judge, place: Path) -> None:
    """Execute a notebook with a cell for each result class, and look at what each cell shows."""
    import nbformat
    from nbclient import NotebookClient

    print("notebook")
    shows = [
        f"one = {code}\none.report({str(place / name)!r} + '.html')\none" for name, code in CELLS.items()
    ]
    cells = [nbformat.v4.new_code_cell(source) for source in (BEGIN, *shows)]
    book = nbformat.v4.new_notebook(cells=cells)
    NotebookClient(book, timeout=300, kernel_name="python3", allow_errors=True).execute()
    failed = [o for c in book.cells for o in c.outputs if o.output_type == "error"]
    judge.that(f"no cell fails{': ' + failed[0].evalue[:120] if failed else ''}", not failed)
    for name, cell in zip(CELLS, book.cells[1:], strict=True):
        shown = "".join(o.data.get("text/html", "") for o in cell.outputs if "data" in o)
        judge.that(
            f"{name}: table and text as HTML, {len(shown) // 1000} kB",
            "<table>" in shown and "<strong>" in shown,
        )
    known = results()
    print(f"  exceptions: {'; '.join(f'{name}: {why}' for name, why in EXCEPTIONS.items())}")
    forgotten = [name for name in known if name not in CELLS and name not in EXCEPTIONS]
    gone = [name for name in (*CELLS, *EXCEPTIONS) if name not in known]
    lacking = [
        f"{n} {member}" for n in CELLS if n in known for member in SHOWS if not hasattr(known[n], member)
    ]
    for what, names in (
        ("every class that a public function returns has its cell or its reason", forgotten),
        ("no cell or reason is of a class that none returns", gone),
        ("every result has " + ", ".join(SHOWS), lacking),
    ):
        judge.that(f"{what}{': not ' + ', '.join(names) if names else ''}", not names)


def _run(place: Path, *words: str) -> tuple[int, str]:
    """Run a command on a terminal of 80 columns and return its exit code and what it printed."""
    ours, its = pty.openpty()
    termios.tcsetwinsize(its, (50, COLUMNS))
    environment = {k: v for k, v in os.environ.items() if k != "COLUMNS"} | {"TERM": "dumb"}
    program = [sys.executable, "-c", "from backdrive.cli import main; main()", *words]
    process = subprocess.Popen(program, cwd=place, env=environment, stdin=its, stdout=its, stderr=its)
    os.close(its)
    printed = b""
    try:
        while part := os.read(ours, 65536):
            printed += part
    except OSError:  # the terminal is closed from the other side
        pass
    os.close(ours)
    return process.wait(), re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", printed.decode(errors="replace")).replace(
        "\r", "\n"
    )


def _too_wide(text: str) -> list[str]:
    return [line for line in text.splitlines() if len(line) > COLUMNS]


def commands(judge: Judge, place: Path, plant: bool) -> None:
    """Measure every command's help in this process, and what the commands print of a demo's log."""
    from typer.main import get_command
    from typer.testing import CliRunner

    from backdrive.cli import app

    print("help")
    os.environ["COLUMNS"] = str(COLUMNS)
    top: Any = get_command(app)
    names: list[list[str]] = [[]]
    for name, command in top.commands.items():
        if command.hidden:
            continue
        names.append([name])
        names += [[name, inner] for inner, one in getattr(command, "commands", {}).items() if not one.hidden]
    wide, cut, bare = [], [], []
    for words in names:
        text = CliRunner().invoke(app, [*words, "--help"]).output + (
            "x" * 81 if plant and words == ["show"] else ""
        )
        shown = " ".join(["backdrive", *words])
        wide += [shown] if _too_wide(text) else []
        cut += (
            [shown]
            if "…" in text
            or any(line.rstrip().endswith("...") for line in text.partition("Commands:")[2].splitlines())
            else []
        )
        bare += [shown] if "Example" not in text else []
    for what, which in (("within 80 columns", wide), ("nothing cut", cut), ("with an example", bare)):
        judge.that(
            f"help of {len(names)} commands {what}{': not ' + ', '.join(which) if which else ''}", not which
        )
    print("output")
    demo = "backdrive-demo"
    log, plan = f"{demo}/log.csv", ("--plan", f"{demo}/plan.json")
    tuned = (
        "--stiffness",
        "8e4:1.2e5",
        "--top-speed",
        "3",
        "--counts",
        "1043038",
        "--joints",
        "8",
        "-o",
        "tuning.json",
    )
    runs = (
        ("demo",),
        ("inspect", log),
        ("plan", "sweep", "--stroke-deg", "20", "--top-speed", "2", "--joint", "j1", "-o", "plan"),
        ("identify", log, *plan, "-o", "model.json", "--report", "report.html"),
        ("show", "model.json"),
        ("show", "preset:mx106/m6"),
        ("validate", "model.json", log),
        ("compare", "model.json", f"{demo}/model.json"),
        ("estimate", "model.json", log, "--report", "force.html"),
        ("tune", "model.json", *tuned),
        ("export", "model.json", "--tuning", "tuning.json", "-o", "firmware"),
        ("laws",),
        ("laws", "stribeck-gauss+lugre"),
        ("reproduce", "--list"),
        ("identify", "nothing.csv"),
    )
    for words in runs:
        code, text = _run(place, *words)
        wide = _too_wide(text)
        fine = code == (3 if words[-1] == "nothing.csv" else 0) and "Traceback" not in text
        rest = f": {wide[0][:110]}" if wide else "" if fine else f": {text[-200:]}"
        judge.that(
            f"backdrive {' '.join(words[:2])}: code {code}, 80 columns, not cut{rest}",
            fine and not wide and not re.search(r"\S…", text),  # a range has spaces: 0.1 … 4
        )


def pages(judge: Judge, place: Path, program: str, short: bool, plant: bool) -> None:
    """Open the reports and the site."""
    print("pages")
    found = {"demo's report": place / "backdrive-demo" / "report.html", "report": place / "report.html"}
    found["report of the force"] = place / "force.html"
    found |= {f"report of {name}": place / f"{name}.html" for name in CELLS}
    if (place / "real.html").exists():
        found["report of a real log"] = place / "real.html"
    if (ROOT / "mkdocs.yml").exists() and shutil.which("mkdocs"):
        site = place / "site"
        built = subprocess.run(
            ["mkdocs", "build", "--strict", "-q", "-d", str(site)],
            cwd=ROOT,
            capture_output=True,
            text=True,
            check=False,
        )
        judge.that(f"the site is built strictly{built.stderr[-200:]}", built.returncode == 0)
        found |= {
            f"site/{p.relative_to(site)}": p for p in sorted(site.rglob("*.html"))[:: 15 if short else 1]
        }
    else:
        print("  (no mkdocs.yml, or no mkdocs: the site's pages are not opened)")
    if plant:
        found["planted"] = place / "planted.html"
        found["planted"].write_text('<p style="width:900px">wide</p><img src="http://example.com/a.png">')
    with serve(place) as address:
        _open_all(judge, place, program, found, address)


def _open_all(judge: Judge, place: Path, program: str, found: dict[str, Path], address: str) -> None:
    """Open every page at every width, light and dark."""
    for name, page in found.items():
        if not page.exists():
            judge.that(f"{name} is there", False)
            continue
        wrong = []
        for width, dark in product(WIDTHS, SCREENS):
            one = visit(program, page, width, dark, place, address)
            where = f"{width} px {'dark' if dark else 'light'}"
            wrong += [f"{where}: wide {one.width} px {one.over[:1]}"] if one.width > width or one.over else []
            wrong += [f"{where}: console {one.console[0]}"] if one.console else []
            wrong += [f"{where}: asks for {one.requests[0]}"] if one.requests else []
            wrong += (
                [f"{where}: empty, or not in that light"] if one.characters < 200 or one.dark != dark else []
            )
        judge.that(f"{name}: at {WIDTHS} px, light and dark{': ' + wrong[0] if wrong else ''}", not wrong)


if __name__ == "__main__":
    main()
