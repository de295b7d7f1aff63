"""Tests for cli/_progress.py: how much is done and how long it takes yet, from the sentences that tell of the work."""

from backdrive.cli._progress import Share, time_words
from backdrive.identification.dynamic.progress import Step, Work, part_of, size_of, ticker


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


def test_the_size_of_a_fit_is_samples_by_unknowns():
    plain, peak, bristle = (size_of(law, 1000) for law in ("coulomb-viscous", "stribeck-gauss", "m6+lugre"))
    assert plain <= peak < bristle
    assert size_of("stribeck-gauss", 3000) == 3.0 * peak


class Bench:
    """A search with a clock of its own."""

    def __init__(self, *sizes):
        self.now, self.heard = 0.0, []
        self.work = Work(self.heard.append, sizes, clock=lambda: self.now)

    def run(self, seconds, searches=2):
        """Run a fit of several searches."""
        self.work.begin("fitting")
        for _ in range(searches):
            for step in range(10):
                self.now += seconds / searches / 10
                self.work.say(Step("fitting", step / 10))


def test_shares_follow_the_size_of_each_law():
    bench = Bench(1.0, 3.0, 6.0)
    bench.run(1.0)
    bench.work.end()
    assert abs(bench.work._now() - 0.1) < 1e-9
    bench.run(3.0)
    bench.work.end()
    assert abs(bench.work._now() - 0.4) < 1e-9


def test_measured_time_takes_the_place_of_what_was_expected():
    bench = Bench(1.0, 1.0, 1.0, 1.0)
    for seconds in (1.0, 1.0, 10.0):
        bench.run(seconds)
    bench.work.end()
    # 12 s for three fits, so 4 s are expected for the fourth
    assert abs(bench.work._now() - 12.0 / 16.0) < 1e-9


def test_the_share_never_goes_back_and_ends_below_one_until_all_is_done():
    bench = Bench(5.0, 1.0, 2.0, 3.0)
    for seconds, searches in ((1.0, 3), (30.0, 1), (2.0, 5)):
        bench.run(seconds, searches)
    bench.work.begin("one more", size=4.0)  # one that was not planned
    bench.work.say(Step("by direction", 0.5))
    bench.run(3.0)
    shares = [step.share for step in bench.heard]
    assert shares == sorted(shares)
    assert shares[0] >= 0.0 and shares[-1] < 1.0
    bench.work.end()
    bench.work.say("the end")
    assert bench.heard[-1].share == 1.0
    assert bench.heard[-1] == "the end"


def test_joints_share_the_work_and_the_command_line_takes_the_share_of_a_sentence():
    heard, share = [], Share()
    tell = part_of(heard.append, 1, 4)
    tell(Step("q2: fitting m6, law 3 of 4", 0.5))
    tell("without")
    assert heard[0].share == 0.375 and heard[1] == "without"
    assert share.hear(heard[0]) == 0.375
    assert share.hear("no count") == 0.375
    assert share.hear(Step("earlier", 0.3)) == 0.375


def test_a_fit_of_several_laws_tells_shares_that_rise():
    from _synthetic import any_motion
    from backdrive import identify

    heard = []
    log = any_motion(lambda v: 5.0 * (v > 0.0) - 5.0 * (v < 0.0) + 2.0 * v, seconds=6.0)
    identify(log, law="coulomb-viscous,stribeck-tustin", progress=heard.append)
    shares = [one.share for one in heard if getattr(one, "share", None) is not None]
    assert len(shares) > 10 and shares == sorted(shares)
    assert shares[0] == 0.0 and 0.5 < shares[-1] <= 1.0
