"""Options of the command line in errors that reach a caller in Python."""

import pytest

from backdrive._options import as_arguments
from backdrive.errors import InvalidInput


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("Give --stiffness LOW:HIGH of it.", "Give stiffness=(LOW, HIGH) of it."),
        ("Give --urdf, or --top-speed.", "Give `urdf`, or `top_speed`."),
        ("For example --band 0.1,2 [Hz].", "For example band=(0.1, 2) [Hz]."),
        ("Use --method arm --urdf ROBOT.", 'Use method="arm" urdf=ROBOT.'),
        ("(--map t=0.001*COLUMN for ms)", '(map="t=0.001*COLUMN" for ms)'),
        ("one a log: --payload 0,0:20,0:20.", 'one a log: payload="0,0:20,0:20".'),
        ("as equal (`--symmetric`).", "as equal (`symmetric`)."),
        ("`backdrive plan ramp --speed 1` shows it.", "`backdrive plan ramp --speed 1` shows it."),
        ("a -- b --, --1, x--y", "a -- b --, --1, x--y"),
    ],
)
def test_options_are_written_as_keyword_arguments(text, expected):
    assert as_arguments(text) == expected


def test_an_error_has_both_forms():
    error = InvalidInput("No top speed.", remedy="Give --top-speed 3.")
    assert str(error) == "No top speed. Give top_speed=3."
    assert error.text == "No top speed. Give --top-speed 3." and error.remedy == "Give --top-speed 3."
