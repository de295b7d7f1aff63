"""What is counted in a tree of sources: statements, docstrings, lines, rooms, repeated blocks, homes by name."""

from __future__ import annotations

import ast
import io
import re
import tokenize
from collections import defaultdict
from collections.abc import Iterator, Mapping
from pathlib import Path

#: Where what is now the room `thesis` lay before; the old side is counted without it, as the new one is without `thesis`.
THESIS = ("thesis", "experiments", "plots/thesis", "reproduce")
BLOCK = 8  # lines that two rooms may not share
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef)
GROUND = "ground"  # the room of all files that lie in no folder

#: What has one home: the file with all functions of such names, methods included. Not gravity in `robot/`, a whole arm's.
HOMES = {
    "huber": re.compile(r"(?:.*_)?huber(?:_.*)?"),
    "covariance": re.compile(r"_?covariance(?:_of|_from)?"),
    "encoder step": re.compile(r"_count|_?encoder_(?:step|count)|_?(?:count|step)_of|_?resolution"),
    "delay line": re.compile(r"_?(?:delayed|delay_line|earlier|later)"),
    "gravity terms": re.compile(r"_?gravity(?:_terms)?"),
}
ELSEWHERE = {("robot/bodies.py", "gravity terms")}


def sources(root: Path) -> dict[str, str]:
    """Return path below the package -> text of every source file."""
    package = root / "src" / "backdrive"
    return {f.relative_to(package).as_posix(): f.read_text() for f in sorted(package.rglob("*.py"))}


def without_thesis(files: Mapping[str, str]) -> dict[str, str]:
    """Return the files that do not reproduce the thesis."""
    return {name: text for name, text in files.items() if not name.startswith(tuple(f"{t}/" for t in THESIS))}


def room(name: str) -> str:
    """Return the room that a file belongs to."""
    first, below, _ = name.partition("/")
    if below:
        return first
    return "robot" if first == "robot.py" else GROUND


def statements(files: Mapping[str, str]) -> int:
    """Return the number of statements, docstrings included."""
    return sum(isinstance(node, ast.stmt) for text in files.values() for node in ast.walk(ast.parse(text)))


def docstrings(files: Mapping[str, str]) -> tuple[float, float]:
    """Return the share of public modules, classes and functions with a docstring, and that of docstrings in all lines."""
    public = described = inside = lines = 0
    for text in files.values():
        lines += len(text.splitlines())
        for node in ast.walk(ast.parse(text)):
            if not isinstance(node, DOCUMENTED):
                continue
            doc = docstring_of(node)
            if doc is not None:
                inside += doc.end_lineno - doc.lineno + 1
            if not getattr(node, "name", "public").startswith("_"):
                public += 1
                described += doc is not None
    return described / public, inside / lines


def docstring_of(node: ast.AST) -> ast.stmt | None:
    """Return the statement that is the docstring of a module, class or function."""
    body = node.body if isinstance(node, DOCUMENTED) else []
    if body and isinstance(body[0], ast.Expr) and isinstance(body[0].value, ast.Constant):
        return body[0] if isinstance(body[0].value.value, str) else None
    return None


def homes(files: Mapping[str, str]) -> dict[str, dict[str, list[str]]]:
    """Return, for every name in HOMES, the files that define one, with the functions."""
    found: dict[str, dict[str, list[str]]] = {what: {} for what in HOMES}
    for name, text in files.items():
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.FunctionDef):
                for what, pattern in HOMES.items():
                    if pattern.fullmatch(node.name) and (name, what) not in ELSEWHERE:
                        found[what].setdefault(name, []).append(node.name)
    return found


def repeated(files: Mapping[str, str]) -> list[tuple[str, int, str, int, int]]:
    """Return the blocks of eight equal lines or more that two rooms share: file, line, file, line, number of lines.

    As pylint's `duplicate-code` counts: comments, docstrings, imports, signatures and blank lines left out, and white space at the
    ends of lines.
    """
    places: dict[tuple[str, ...], list[tuple[str, int]]] = defaultdict(list)
    code = {name: list(_code_lines(text)) for name, text in files.items()}
    for name, lines in code.items():
        for k in range(len(lines) - BLOCK + 1):
            places[tuple(text for _, text in lines[k : k + BLOCK])].append((name, k))
    runs: dict[tuple[str, str, int], list[int]] = defaultdict(list)
    for at in places.values():
        for i, (a, k) in enumerate(at):
            for b, m in at[i + 1 :]:
                if room(a) != room(b):
                    runs[a, b, m - k].append(k)
    found = []
    for (a, b, shift), starts in sorted(runs.items()):
        starts.sort()
        first = starts[0]
        for before, after in zip(starts, [*starts[1:], None], strict=False):
            if after != before + 1:
                size = before - first + BLOCK
                found.append((a, code[a][first][0], b, code[b][first + shift][0], size))
                first = after
    return found


def _code_lines(text: str) -> Iterator[tuple[int, str]]:
    """Yield number and content of the lines that count as code."""
    ignored: set[int] = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import | ast.ImportFrom):
            ignored.update(range(node.lineno, node.end_lineno + 1))
        if isinstance(node, ast.FunctionDef):
            ignored.update(range(node.lineno, node.body[0].lineno))
        doc = docstring_of(node)
        if doc is not None:
            ignored.update(range(doc.lineno, doc.end_lineno + 1))
    lines = text.splitlines()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            row, column = token.start
            lines[row - 1] = lines[row - 1][:column]
    for number, line in enumerate(lines, 1):
        if number not in ignored and line.strip():
            yield number, line.strip()
