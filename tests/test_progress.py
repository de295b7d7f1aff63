"""Tests for cli/_progress.py: how much is done and how long it takes yet, from the sentences that tell of the work."""

from backdrive.cli._progress import Share, time_words
from backdrive.identification.dynamic.progress import ticker


def test_what_is_done_is_a_share_of_the_whole():
    share = Share()
    assert share.hear("Reading") is None
    assert share.hear("3 of 20 logs, robot_7.npz") == 0.15
    assert share.hear("Drawing") == 0.15  # a sentence without a count leaves it
    assert share.hear("400 of at most 200 rounds") == 1.0


def test_what_is_begun_counts_as_not_yet_done_and_laws_belong_to_their_joint():
    share = Share()
    assert share.hear("Identifying q1 (dynamic), joint 1 of 2") == 0.0
    assert share.hear("q1: fitting m6, law 3 of 4") == 0.25
    assert share.hear("q1: fitting m6, step 15") == 0.25
    assert share.hear("Identifying q2 (dynamic), joint 2 of 2") == 0.5  # whose laws are not begun
    assert share.hear("q2: fitting gms, law 4 of 4") == 0.875
    assert share.hear("q2, joint 2 of 2: Closing in, part 1 of 5") == 0.5


def test_a_single_law_is_in_parts_and_a_second_fit_of_it_does_not_go_back():
    share = Share()
    assert share.hear("q1: fitting lugre, step 5, part 1 of 10") == 0.0
    assert share.hear("q1: fitting lugre, step 40, part 6 of 10") == 0.5
    assert share.hear("q1: fitting lugre, step 5, part 1 of 10") == 0.5
    assert share.hear("q1: fitting gms, law 2 of 4") == 0.25
    assert share.hear("q1: fitting gms, step 5, part 1 of 10") == 0.25


def test_a_fit_reports_its_parts():
    heard = []
    tick = ticker(heard.append, "q1", 72)
    for i in range(90):
        tick("lugre", i, 1.0)
    assert heard[0] == "q1: fitting lugre, step 0, part 1 of 10"
    assert heard[-1] == "q1: fitting lugre, step 85, part 10 of 10"


def test_time_left_goes_on_from_when_the_share_was_known():
    assert time_words(1.0, 0.5) == ""
    assert time_words(10.0, None) == "10 s"
    assert time_words(10.0, 0.25) == "10 s, 25 %, about 30 s left"
    assert time_words(20.0, 0.25, since=10.0) == "20 s, 25 %, about 20 s left"
    assert time_words(60.0, 0.25, since=50.0) == "60 s, 25 %"  # longer than was thought: no word of the rest
