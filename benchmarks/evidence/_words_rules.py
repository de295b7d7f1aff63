"""The rules of names and sentences: which names are participles, what a sentence is, where public symbols are listed."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

#: Irregular participles. `read`, `set`, `cut`, `split`, `fit` are verbs in the same form and are no entries.
IRREGULAR = frozenset(
    """found said shown known given taken made built told kept left lost held met sent thought seen done gone begun written drawn
    chosen hidden broken worn torn heard felt understood paid brought caught bought sought fought taught dealt meant spent slept
    swept led fed bred stuck struck swung spun won grown thrown flown frozen spoken stolen woken forgotten driven risen ridden
    eaten fallen beaten borne sworn""".split()  # noqa: SIM905  (a list of words reads as words)
)
#: Words in -ed that are no participles.
OTHER = frozenset(
    {"bed", "embed", "exceed", "feed", "need", "proceed", "red", "seed", "shed", "speed", "succeed", "wed"}
)
#: Terms that stay: the words of a name in a row -> why.
ALLOWED = {
    "bound": "the noun: an end of a range",
    "closed_loop": "control under feedback is closed loop in every textbook",
    "fixed": "the adjective: the same for every case",
    "held_out": "the term for data that a fit does not see",
    "repeated_time": "the code of a check, which a person writes in `accept`",
    "smoothed_maxwell_slip": "the law's name in the literature",
    "stuck": "the code of a check, which a person writes in `accept`",
    "unsorted_time": "the code of a check, which a person writes in `accept`",
}
#: A predicate is read as a sentence: `joint.is_known`.
PREDICATES = ("is", "has")
SECTIONS = (
    "Args:",
    "Returns:",
    "Raises:",
    "Attributes:",
    "Yields:",
    "Example:",
    "Examples:",
    "Note:",
    "References:",
)
ENTRIES = ("Args:", "Returns:", "Raises:", "Attributes:", "Yields:", "Example:", "Examples:", "References:")


@dataclass(frozen=True)
class Name:
    """A name in a source file.

    Attributes:
        kind: `file`, `class` or `function`.
        name: itself.
        place: path and line.
    """

    kind: str
    name: str
    place: str


def words_of(name: str) -> list[str]:
    """Return the words of a name in lower case: `SweepRun_of` -> sweep, run, of."""
    return [w.lower() for w in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+", name)]


def participles(name: str) -> list[str]:
    """Return the participles among a name's words, without those of allowed terms and of predicates."""
    words = words_of(name)
    if words[:1] and words[0] in PREDICATES and len(words) > 1:
        return []
    text = "_".join(words)
    for term in ALLOWED:
        text = re.sub(rf"(?<![a-z]){term}(?![a-z])", "", text)
    rest = [w for w in text.split("_") if w]
    return [w for w in rest if w in IRREGULAR or (w.endswith("ed") and len(w) > 3 and w not in OTHER)]


def names(root: Path) -> Iterator[Name]:
    """Yield the names of all files, classes, functions and methods below a folder."""
    for path in sorted(root.rglob("*.py")):
        place = str(path.relative_to(root))
        yield Name("file", path.stem, place)
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef):
                yield Name("class", node.name, f"{place}:{node.lineno}")
            elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                yield Name("function", node.name, f"{place}:{node.lineno}")


def offences(root: Path) -> list[tuple[Name, list[str]]]:
    """Return the names below a folder that hold participles, with these."""
    return [(name, hits) for name in names(root) if (hits := participles(name.name))]


def docstrings(root: Path) -> Iterator[tuple[str, str, str]]:
    """Yield room, place and text of every docstring below a folder; files beside the rooms are the room `.`."""
    for path in sorted(root.rglob("*.py")):
        relative = path.relative_to(root)
        room = relative.parts[0] if len(relative.parts) > 1 else "."
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
                text = ast.get_docstring(node)
                if text:
                    yield room, f"{relative}:{getattr(node, 'lineno', 1)}", text


def prose(docstring: str) -> list[str]:
    """Return the paragraphs of a docstring: no entries of sections, which are short, no code, no lists."""
    kept, section, fence = [], False, False
    for line in docstring.split("\n"):
        bare = line.strip()
        fence ^= bare.startswith("```")
        if bare in SECTIONS:
            section = bare in ENTRIES
            kept.append("")
        elif section and bare and not line.startswith(" "):
            section = False
        if section or fence or bare in SECTIONS or bare.startswith(("```", ">>>", "- ", "* ", "| ", "$$")):
            continue
        kept.append("" if line.startswith("    ") else bare)
    return [" ".join(p.split("\n")) for p in re.split(r"\n{2,}", "\n".join(kept).strip()) if p.strip()]


def sentences(paragraph: str) -> list[str]:
    """Return the sentences of a paragraph: each ends in . ! or ? before a space and no lower-case letter, or with the paragraph.

    A colon or a semicolon ends none.
    """
    return [s for s in re.split(r"(?<=[.!?])[\"')`]?\s+(?=[^a-z\s])", paragraph.strip()) if length(s)]


def length(sentence: str) -> int:
    """Return how many words a sentence has: what stands between spaces and holds a letter or a digit."""
    return sum(bool(re.search(r"\w", w)) for w in sentence.split())


def glossary(text: str) -> dict[str, list[str]]:
    """Return the banned synonyms of each term of a glossary, from tables `Term | Meaning | Not`."""
    banned: dict[str, list[str]] = {}
    inside = False
    for line in text.splitlines():
        cells = [c.strip() for c in re.split(r"(?<!\\)\|", line.strip().strip("|"))]
        if len(cells) != 3:
            inside = False
        elif [c.lower() for c in cells] == ["term", "meaning", "not"]:
            inside = True
        elif inside and not re.fullmatch(r"[-: ]+", cells[0]):
            words = (w.strip(" `\"'*.") for w in re.split(r"[,;]", cells[2]))
            banned[cells[0].strip("*`")] = [w for w in words if re.search(r"[A-Za-z]", w)]
    return banned


def without_code(text: str) -> str:
    """Return Markdown without code, with its lines kept: a name in code is not a word."""
    text = re.sub(r"```.*?```", lambda m: "\n" * m[0].count("\n"), text, flags=re.S)
    return re.sub(r"`[^`\n]*`", "", text)


def uses(word: str, text: str) -> list[str]:
    """Return the lines of a text that use a word, in any case, as a word of its own or in the plural."""
    form = re.compile(rf"(?<![\w-]){re.escape(word)}(?:s|es)?(?![\w-])", re.IGNORECASE)
    return [line.strip() for line in text.splitlines() if form.search(line)]


def directives(text: str) -> list[tuple[str, list[str] | None]]:
    """Return what the directives `::: path` of an API page show: the path, and its members where they are chosen."""
    result = []
    for block in re.split(r"^(?=::: )", text, flags=re.M)[1:]:
        path = block.split("\n", 1)[0].removeprefix("::: ").strip()
        chosen = re.search(r"^\s+members:\s*\n((?:\s+- .*\n?)+)", block, flags=re.M)
        plain = re.search(r"^\s+members:\s*\[(.*)\]", block, flags=re.M)
        names_ = (
            re.findall(r"- (\S+)", chosen[1])
            if chosen
            else plain[1].replace(" ", "").split(",")
            if plain
            else None
        )
        result.append((path, names_))
    return result
