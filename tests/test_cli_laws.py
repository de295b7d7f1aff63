"""`backdrive laws`: the catalogue, one law, a pair, pictures; and what is answered to a name that is not one."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from backdrive.cli import main
from backdrive.laws import ELEMENTS, RATES


@pytest.fixture
def laws(monkeypatch, capsys):
    def run(*arguments):
        monkeypatch.setenv("COLUMNS", "100")
        monkeypatch.setattr(sys, "argv", ["backdrive", "laws", *map(str, arguments)])
        with pytest.raises(SystemExit) as stopped:
            main()
        said = capsys.readouterr()
        return stopped.value.code or 0, said.out, said.err

    return run


def test_the_catalogue_lists_every_law_with_its_parameters(laws):
    code, out, _ = laws()
    assert code == 0
    rates, elements = out.split("presliding element")
    first_words = [
        {line.split()[0] for line in part.splitlines() if line.strip()} for part in (rates, elements)
    ]
    assert set(RATES) <= first_words[0]
    assert set(ELEMENTS) <= first_words[1]
    for kind in (*RATES.values(), *ELEMENTS.values()):
        assert all(parameter in out for parameter in kind.PARAMETERS)


def test_one_law_shows_equation_parameters_source_and_claims(laws):
    code, out, _ = laws("lugre")
    assert code == 0
    assert "z' = v - sigma_0 |v| z / s(v)" in out
    row = next(line for line in out.splitlines() if line.split()[:1] == ["stiffness"])
    assert "sigma_0" in row
    assert "N.m/rad or N/m" in row
    assert ">= 1e-9" in row
    assert "1e5 [1]" in row
    assert "[1] Canudas de Wit et al." in out
    assert "Vibration below break-away drifts." in out
    assert "Carries: coulomb," in out
    assert "Carries: none" not in out
    assert "makkar" not in out


def test_a_smooth_law_says_what_carries_it_and_why_nothing_else(laws):
    _, out, _ = laws("makkar")
    assert "Carried by: none." in out
    assert "continuous and zero at rest" in " ".join(out.split())


@pytest.mark.parametrize("name", [*RATES, *ELEMENTS])
def test_every_law_can_be_shown_in_ascii(laws, name):
    code, out, _ = laws(name)
    assert code == 0
    assert out.startswith(name)
    assert set(out.encode("utf-8").decode()) - {"─"} <= {chr(i) for i in range(128)}


def test_a_pair_shows_both(laws):
    code, out, _ = laws("stribeck-gauss+lugre")
    assert code == 0
    assert "\nlugre  " in out
    assert out.startswith("stribeck-gauss  ")


def test_json(laws):
    code, out, _ = laws("--json")
    catalogue = json.loads(out)
    assert code == 0
    assert [kind["name"] for kind in catalogue["rates"]] == list(RATES)
    assert [kind["name"] for kind in catalogue["elements"]] == list(ELEMENTS)
    code, out, _ = laws("polyline+decaying", "--json")
    document = json.loads(out)
    assert [part["kind"] for part in document["parts"]] == ["rate", "element"]
    stiffness = document["parts"][1]["parameters"]["stiffness"]
    assert (stiffness["unit"], stiffness["unit_linear"]) == ("N.m/rad", "N/m")
    assert stiffness["upper"] is None
    assert document["example"]["parameters"]["velocity"] == [0.05, 0.2, 1.0]
    assert "makkar" not in document["parts"][1]["combines_with"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("lugrey",), "Did you mean 'lugre'?"),
        (("polylin+dahl",), "Did you mean 'polyline'?"),
        (("polyline+dalh",), "Did you mean 'dahl'?"),
        (("lugre+polyline",), "polyline+lugre"),
        (("makkar+lugre",), "continuous and zero at rest"),
        (("", "--json"), ""),
        (("coulomb", "--plot", "x.pdf"), "'pdf'"),
        (("coulomb", "--plot", "no/such/folder.png"), "Cannot write"),
        (("--plot", "x.png"), "No law was named to draw"),
    ],
)
def test_failures_are_one_message(laws, arguments, words):
    code, out, err = laws(*arguments)
    assert code == 2
    if "--json" in arguments:
        assert json.loads(out)["ok"] is False
        assert err == ""
    else:
        assert words in " ".join(err.split())
        assert err.count("backdrive: ") == 1
        assert out == ""


@pytest.mark.parametrize("suffix", ["svg", "png"])
def test_plot(laws, tmp_path, suffix):
    picture = tmp_path / f"signatures.{suffix}"
    code, out, _ = laws("coulomb-viscous+decaying", "--plot", picture)
    assert code == 0
    assert out.splitlines()[-1] == f"Wrote {picture}."
    assert picture.read_bytes()[:8] == {"svg": b"<?xml ve", "png": b"\x89PNG\r\n\x1a\n"}[suffix]


def test_a_missing_plotting_extra_is_named(laws, monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    code, out, err = laws("coulomb", "--plot", tmp_path / "x.png")
    assert code == 2
    assert "backdrive[report]" in err
    assert out == ""
    assert not list(tmp_path.iterdir())


def test_help_loads_no_compiler_and_has_an_example():
    code = (
        "import sys; sys.argv = ['backdrive', 'laws', '--help']\n"
        "from backdrive.cli import main\n"
        "try:\n    main()\n"
        "except SystemExit: pass\n"
        "assert not {'numba', 'numpy', 'matplotlib'} & set(sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "Example: backdrive laws" in done.stdout
