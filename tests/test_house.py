"""The rules of the house, as tests: layers, docstrings with units, import cost, no unsafe loaders."""

import ast
import importlib
import os
import pkgutil
import re
import subprocess
import sys
from collections.abc import Collection, Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

import backdrive

SOURCE = Path(backdrive.__file__).parent
FILES = sorted(SOURCE.rglob("*.py"))
HEAVY = (
    "numba",
    "matplotlib",
    "mujoco",
    "pinocchio",
    "scipy",
    "pyarrow",
    "h5py",
    "rosbags",
    "mcap",
    "typer",
    "rich",
)
UNIT = re.compile(r"\[[^\]\s][^\]]*\]")


def modules() -> list[str]:
    return [
        "backdrive",
        *(
            m.name
            for m in pkgutil.walk_packages(backdrive.__path__, "backdrive.")
            if "__main__" not in m.name
        ),
    ]


def loaded_after(statement: str) -> set[str]:
    code = f"import sys; {statement}; print('\\n'.join(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return {name.split(".")[0] for name in done.stdout.split()}


def test_importing_backdrive_loads_nothing_heavy():
    loaded = loaded_after("import backdrive")
    assert not loaded & {*HEAVY, "numpy"}


def test_identification_imports_no_slow_part_of_scipy():
    """`scipy.signal` and `scipy.stats` take more than half a second: they are imported where they are used."""
    code = "import sys, backdrive.identification.pipeline; print([m for m in ('scipy.signal', 'scipy.stats') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_help_loads_no_numerics():
    loaded = loaded_after("import backdrive.cli")
    assert not loaded & ({*HEAVY, "numpy"} - {"typer", "rich"})


def statements(nodes: list[ast.stmt]) -> Iterator[ast.Import | ast.ImportFrom]:
    """The import statements that run when the module is imported."""
    for node in nodes:
        if isinstance(node, ast.Import | ast.ImportFrom):
            yield node
        elif isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            yield from statements(node.orelse)
        elif not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            for part in ("body", "orelse", "finalbody", "handlers"):
                for inner in getattr(node, part, []):
                    yield from statements(inner.body if isinstance(inner, ast.ExceptHandler) else [inner])


def imports(name: str, text: str, package: str, known: Collection[str]) -> set[str]:
    """The modules that importing `name` runs: those it names, and the packages that hold these and not itself."""
    found = set()
    for node in statements(ast.parse(text).body):
        if isinstance(node, ast.Import):
            targets = [alias.name for alias in node.names]
        else:
            home = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            base = ".".join([*home, *([node.module] if node.module else [])])
            targets = [inner if (inner := f"{base}.{a.name}") in known else base for a in node.names]
        for target in set(targets) & set(known):
            found.add(target)
            parts = target.split(".")
            holders = {".".join(parts[:n]) for n in range(1, len(parts))}
            found |= {holder for holder in holders if not f"{name}.".startswith(f"{holder}.")}
    return found


def import_order(texts: dict[str, str], packages: set[str]) -> list[str]:
    """An order in which each module imports only those before it. Raises CycleError where there is none."""
    homes = {name: name if name in packages else name.rpartition(".")[0] for name in texts}
    graph = {name: imports(name, text, homes[name], texts.keys()) for name, text in texts.items()}
    return list(TopologicalSorter(graph).static_order())


def test_every_module_can_be_imported_first():
    """No cycle of imports, so that no module depends on what was imported before it."""
    texts, packages = {}, set()
    for file in FILES:
        parts = file.relative_to(SOURCE.parent).with_suffix("").parts
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        texts[name] = file.read_text()
        if parts[-1] == "__init__":
            packages.add(name)
    assert len(import_order(texts, packages)) == len(texts) > 100


@pytest.mark.parametrize(
    "texts",
    [
        {"p": "", "p.a": "from .b import f", "p.b": "from . import a"},
        {"p": "from p.a import f", "p.a": "from p import g"},
        {
            "p": "",
            "p.a": "import p.q.z",
            "p.q": "try:\n    from ..a import f\nexcept KeyError:\n    f = None",
            "p.q.z": "",
        },
    ],
)
def test_cycle_of_imports_is_detected(texts):
    with pytest.raises(CycleError):
        import_order(texts, {"p", "p.q"})


def test_every_module_imports_without_warnings():
    names = modules()
    code = "import importlib, sys; [importlib.import_module(name) for name in sys.stdin.read().split()]"
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        env=os.environ | {"NUMBA_DISABLE_JIT": "1"},  # what imports what is the same, and half of the time
        input="\n".join(names),
        capture_output=True,
        text=True,
        check=False,
    )
    assert len(names) > 100
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_layers_hold():
    root = SOURCE.parent.parent
    done = subprocess.run(
        ["lint-imports", "--no-cache"], cwd=root, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout


def test_every_public_name_has_one_home():
    for name in backdrive.__all__:
        value = getattr(backdrive, name)
        if name != "__version__":
            assert value.__module__.startswith("backdrive")
    assert set(dir(backdrive)) == set(backdrive.__all__)


def public_functions():
    for file in FILES:
        for node in ast.walk(ast.parse(file.read_text())):
            if (
                isinstance(node, ast.FunctionDef)
                and not node.name.startswith("_")
                and ast.get_docstring(node)
            ):
                yield file, node


def test_documented_quantities_carry_units():
    """An argument documented as a torque, velocity, time ... says its unit in brackets."""
    quantity = re.compile(
        r"^\s+(\w*(?:torque|velocity|speed|stroke|inertia|cutoff|rate|period|time|duration)\w*): (.*)$"
    )
    plain = {"rate_law", "time_slip"}
    missing = []
    for file, node in public_functions():
        arguments = {
            a.arg: ast.unparse(a.annotation) if a.annotation else ""
            for a in [*node.args.args, *node.args.kwonlyargs]
        }
        doc = ast.get_docstring(node)
        for i, line in enumerate(doc.splitlines()):
            match = quantity.match(line)
            if not match or match[1] not in arguments or match[1] in plain:
                continue
            if not re.search(r"float|ndarray", arguments[match[1]]):
                continue
            rest = " ".join([match[2], *doc.splitlines()[i + 1 : i + 3]])
            if not UNIT.search(rest) and "unit" not in rest:
                missing.append(f"{file.relative_to(SOURCE)}:{node.name}: {match[1]}")
    assert not missing


def test_no_unsafe_loader():
    forbidden = re.compile(
        r"\bpickle\.(?:loads?|dumps?|Unpickler)\(|allow_pickle=True|yaml\.load\(|(?<![\w.])eval\(|(?<![\w.])exec\("
    )
    found = [f.name for f in FILES if forbidden.search(f.read_text())]
    assert not found


def test_optimisers_live_where_parameters_are_sought():
    homes = {"identification", "plans", "tuning"}
    found = [
        f for f in FILES if "scipy.optimize" in f.read_text() and f.relative_to(SOURCE).parts[0] not in homes
    ]
    assert not found


def test_files_stay_small():
    long = {str(f.relative_to(SOURCE)): n for f in FILES if (n := len(f.read_text().splitlines())) > 350}
    assert not long


def test_the_version_is_the_packages():
    from importlib.metadata import version

    assert backdrive.__version__ == version("backdrive")
    assert importlib.import_module("backdrive.errors").BackdriveError.exit_code == 4


def test_the_package_says_that_it_has_types():
    assert (SOURCE / "py.typed").is_file()


def test_evidence_asks_for_names_that_are_there():
    wanted = {
        (node.module, alias.name)
        for path in (Path(__file__).parents[1] / "benchmarks").rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("backdrive")
        for alias in node.names
        if path.stem != "_same_truth_side"  # speaks the former interface too
    }
    assert len(wanted) > 100
    absent = []
    for module, name in sorted(wanted):
        try:
            if not hasattr(importlib.import_module(module), name):
                importlib.import_module(f"{module}.{name}")
        except ModuleNotFoundError:
            absent.append(f"{module}.{name}")
    assert not absent
