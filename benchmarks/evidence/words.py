"""The words of the project: names, sentences, synonyms, and whether every public symbol has its place in the API pages.

- Names of files, classes and functions hold no past participles. Those that stay are printed with the reason.
- The docstrings' sentences have at most 18 words in the mean, in every room. Counted are paragraphs of prose: no entries of
  `Args`, `Returns`, `Raises` and `Attributes`, no lists, no code, for their few words would flatter the mean. A sentence ends
  in . ! or ?; a colon or a semicolon ends none. A word stands between spaces.
- No synonym that the glossary bans is in the docs, the docstrings or the command line's help. Code is no prose.
- Every name of `backdrive.__all__`, and of the `__all__` of every package below it, is shown by a directive of docs/api.

`--plant NAME` adds a function of that name to what is looked at, to see the program fall short.
"""

from __future__ import annotations

import ast
import importlib
import pkgutil
import tempfile
from collections import defaultdict
from pathlib import Path
from typing import Any

import _words_rules as rules
from _common import Judge, parser

import backdrive

SOURCE = Path(backdrive.__file__).parent
DOCS = SOURCE.parents[1] / "docs"
MEAN, LONGEST = 18.0, 10


def names(judge: Judge, plant: str | None) -> None:
    """Judge the names of files, classes and functions."""
    print("\nnames: past participles that stay")
    for term, reason in rules.ALLOWED.items():
        print(f"    {term:24s} {reason}")
    print(f"    {'is_..., has_...':24s} a predicate is read as a sentence")
    found = rules.offences(SOURCE)
    if plant:
        with tempfile.TemporaryDirectory() as folder:
            Path(folder, "plant.py").write_text(f"def {plant}():\n    pass\n", encoding="utf-8")
            found += rules.offences(Path(folder))
    for name, hits in found:
        print(f"    {name.kind} {name.name} ({', '.join(hits)}) in {name.place}")
    count = sum(1 for _ in rules.names(SOURCE))
    judge.that(f"participles among {count} names of files, classes and functions: {len(found)}", not found)


def sentences(judge: Judge) -> None:
    """Judge the lengths of the docstrings' sentences, and print the longest ones of each room."""
    lengths: dict[str, list[tuple[int, str, str]]] = defaultdict(list)
    for room, place, text in rules.docstrings(SOURCE):
        for sentence in (s for p in rules.prose(text) for s in rules.sentences(p)):
            lengths[room].append((rules.length(sentence), place, sentence))
    every = [n for rows in lengths.values() for n, _, _ in rows]
    print(f"\nsentences of docstrings: {len(every)}; the longest of each room")
    means = {}
    for room, rows in sorted(lengths.items()):
        means[room] = sum(n for n, _, _ in rows) / len(rows)
        longest = sorted(rows, reverse=True)[:LONGEST]
        print(
            f"  {room:16s} {len(rows):5d} sentences, mean {means[room]:5.2f}, longest {longest[0][0]} words"
        )
        for n, place, sentence in longest[:3]:
            print(f"      {n:3d} {place}: {sentence[:90]}")
    worst = max(means, key=lambda room: means[room])
    judge.at_most("mean over all rooms", sum(every) / len(every), MEAN, "words")
    judge.at_most(f"mean of the room with the longest, {worst}", means[worst], MEAN, "words")


def helps() -> dict[str, str]:
    """Return the help of every command and option, by place."""
    import typer

    from backdrive.cli import app

    found: dict[str, str] = {}

    def walk(command: Any, path: str) -> None:
        found[path] = command.help or ""
        for one in command.params:
            found[f"{path} {one.name}"] = getattr(one, "help", None) or ""
        for name, inner in getattr(command, "commands", {}).items():
            walk(inner, f"{path} {name}")

    walk(typer.main.get_command(app), "backdrive")
    return found


def synonyms(judge: Judge) -> None:
    """Judge whether the words that the glossary bans are used."""
    page = DOCS / "glossary.md"
    print("\nsynonyms that the glossary bans")
    if not page.exists():
        judge.that("docs/glossary.md exists", False)
        return
    banned = rules.glossary(page.read_text(encoding="utf-8"))
    judge.that(f"terms in the glossary: {len(banned)} (at least 30)", len(banned) >= 30)
    texts = {
        f"docs/{p.relative_to(DOCS)}": p.read_text(encoding="utf-8")
        for p in sorted(DOCS.rglob("*.md"))
        if p != page
    }
    texts |= {"README.md": (DOCS.parent / "README.md").read_text(encoding="utf-8")} | helps()
    places = list(texts.items()) + [(place, text) for _, place, text in rules.docstrings(SOURCE)]
    hits = 0
    for term, words in banned.items():
        for word in words:
            for place, text in places:
                for line in rules.uses(word, rules.without_code(text)):
                    hits += 1
                    print(f"    '{word}' for {term} in {place}: {line[:80]}")
    count = sum(map(len, banned.values()))
    judge.that(f"uses of {count} banned synonyms in {len(places)} texts: {hits}", hits == 0 and count > 0)


def public() -> dict[str, str]:
    """Return every public symbol, `backdrive.x.name`, and where it is defined."""
    packages = [
        "backdrive",
        *(m.name for m in pkgutil.walk_packages(backdrive.__path__, "backdrive.") if m.ispkg),
    ]
    found = {}
    for package in packages:
        if any(part.startswith("_") for part in package.split(".")):
            continue
        # a package in which an `__all__` is written, not one that only a star would give
        tree = ast.parse(
            Path(*SOURCE.parts, *package.split(".")[1:], "__init__.py").read_text(encoding="utf-8")
        )
        targets = [
            t.id for n in tree.body if isinstance(n, ast.Assign) for t in n.targets if isinstance(t, ast.Name)
        ]
        if "__all__" not in targets:
            continue
        module = importlib.import_module(package)
        for name in module.__all__:
            if name.startswith("__"):
                continue
            value = getattr(module, name)
            home = getattr(value, "__module__", None) if callable(value) else None
            found[f"{package}.{name}"] = (
                f"{home or package}.{getattr(value, '__name__', name) if home else name}"
            )
    return found


def api(judge: Judge) -> None:
    """Judge whether every public symbol is shown in the API pages."""
    print("\npublic symbols")
    pages = sorted((DOCS / "api").rglob("*.md"))
    shown: dict[str, list[str] | None] = {}
    for page in pages:
        for path, members in rules.directives(page.read_text(encoding="utf-8")):
            known = shown.get(path, [])
            shown[path] = None if members is None or known is None else [*known, *members]
    missing = []
    for symbol, home in public().items():
        for path in (symbol, home):
            module, _, name = path.rpartition(".")
            if path in shown or (module in shown and ((only := shown[module]) is None or name in only)):
                break
        else:
            missing.append(symbol)
    for symbol in missing:
        print(f"    {symbol} is in no page")
    judge.that(
        f"public symbols missing from {len(pages)} API pages: {len(missing)} of {len(public())}",
        bool(pages) and not missing,
    )


def main() -> None:
    """Judge names, sentences, synonyms and the API pages."""
    options = parser(__doc__)
    options.add_argument(
        "--plant", metavar="NAME", help="add a function of that name, to see the program fall short"
    )
    asked = options.parse_args()
    judge = Judge()
    names(judge, asked.plant)
    sentences(judge)
    synonyms(judge)
    api(judge)
    judge.end()


if __name__ == "__main__":
    main()
