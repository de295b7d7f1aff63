"""Names are nouns and verbs of the field; the rules are those of the evidence program `words`."""

import sys
from functools import cache
from pathlib import Path

import pytest

import backdrive

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks" / "evidence"))
import _words_rules as rules

SOURCE = Path(backdrive.__file__).parent
offences = cache(lambda: rules.offences(SOURCE))


#: Rooms whose names are not given yet; an entry that is done fails, so that it is taken out.
PENDING: tuple[str, ...] = ()
ROOMS = sorted({name.place.split("/")[0] if "/" in name.place else "." for name in rules.names(SOURCE)})


@pytest.mark.parametrize(
    "room",
    [pytest.param(r, marks=pytest.mark.xfail(strict=True)) if r in PENDING else r for r in ROOMS],
)
def test_no_file_class_or_function_is_named_by_a_participle(room):
    found = [
        f"{name.kind} {name.name} in {name.place}"
        for name, _ in offences()
        if (name.place.split("/")[0] if "/" in name.place else ".") == room
    ]
    assert found == []


@pytest.mark.parametrize(
    ("name", "hits"),
    [
        ("found", ["found"]),
        ("_left_out", ["left"]),
        ("Fitted", ["fitted"]),
        ("MotionJudged", ["judged"]),
        ("top_speed", []),
        ("read_log", []),
        ("bound_of", []),
        ("is_known", []),
        ("held_out_errors", []),
        ("held_force", ["held"]),
        ("SmoothedMaxwellSlip", []),
    ],
)
def test_a_participle_is_told_from_a_noun(name, hits):
    assert rules.participles(name) == hits


def test_a_planted_name_is_seen(tmp_path):
    (tmp_path / "judging.py").write_text("class Asked:\n    def shown(self):\n        def speed(): ...\n")
    (tmp_path / "moved.py").write_text("")
    found = [(name.kind, name.name) for name, _ in rules.offences(tmp_path)]
    assert found == [("class", "Asked"), ("function", "shown"), ("file", "moved")]


def test_sentences_are_counted_without_entries_and_code():
    text = "Say one thing.\n\nIt has e.g. two words: here; there. Then `x` ends it.\n\nArgs:\n    x: a number. Of some size."
    counted = [rules.length(s) for p in rules.prose(text) for s in rules.sentences(p)]
    assert counted == [3, 7, 4]


def test_banned_synonyms_are_read_and_seen():
    banned = rules.glossary(
        "| Term | Meaning | Not |\n| --- | --- | --- |\n| break-away | start | unstick, `stiction` |\n"
    )
    assert banned == {"break-away": ["unstick", "stiction"]}
    assert rules.uses("stiction", "Stiction is\nfine, `no`") == ["Stiction is"]
    assert rules.uses("stiction", rules.without_code("`stiction` in code")) == []


def test_directives_are_read_with_their_members():
    page = "::: backdrive.errors\n\n::: backdrive.model\n    options:\n      members:\n        - load_model\n"
    assert rules.directives(page) == [("backdrive.errors", None), ("backdrive.model", ["load_model"])]
