"""Statements of chapter 2 of Iwatani 2017 about its figures and its table."""

from __future__ import annotations

from backdrive.thesis.statement import EXPLAINED, REPRODUCED, UNJUDGED, Statement

CHAPTER_2: tuple[Statement, ...] = (
    Statement(
        name="2.2-duration",
        section="2.4.2",
        experiment="fig-2.2",
        text="The time required for tracking the trajectory is proportional to A as in (2.15), which can be seen in (2.3) "
        "and Figure 2.2.",
        verdict=REPRODUCED,
    ),
    Statement(
        name="2.6-joint-1",
        section="2.4.2",
        experiment="fig-2.6",
        text="Figure 2.6 is the result of Joint 1, where the effect of the gravity and the inertia is the largest among all "
        "joints.",
        verdict=UNJUDGED,
        why="inertia and gravity of the joints are not printed",
    ),
    Statement(
        name="2.6-broader",
        section="2.4.2",
        experiment="fig-2.6",
        text="It can be seen that smaller A broadens the width of the curves.",
        verdict=REPRODUCED,
    ),
    Statement(
        name="2.6-perturbed",
        section="2.4.2",
        experiment="fig-2.6",
        text="Smaller A also perturbs the fitted curve.",
        verdict=REPRODUCED,
    ),
    Statement(
        name="2.7-overlap",
        section="2.4.2",
        experiment="fig-2.7",
        text="In this figure, one can see that the curves of A larger than 10 deg are almost overlapping.",
        verdict=REPRODUCED,
    ),
    Statement(
        name="2.7-slope",
        section="2.4.2",
        experiment="fig-2.7",
        text="It is clear that the slope of the identified curves in the high velocity range is different from that in low "
        "velocity range.",
        verdict=UNJUDGED,
        why="the friction curves are printed as pictures without numbers: the bend of a simulated joint's friction is put in",
    ),
    Statement(
        name="2.7-limit",
        section="2.4.2",
        experiment="fig-2.7",
        text="The result in the case of A = 5 deg at Joint 1 was not obtained due to the limit of the servo controller (caption).",
        verdict=EXPLAINED,
        why="here 5 deg asks Joint 1 for 91 % of its torque and is obtained; with 1.9 kg.m^2 instead of the assumed 1.6 the "
        "limit is reached",
    ),
    Statement(
        name="2.8-large",
        section="2.4.2",
        experiment="fig-2.8",
        text="It is shown that the differences are large when A = 5 or 10 deg; these results correspond to Figure 2.7.",
        verdict=REPRODUCED,
    ),
    Statement(
        name="2.9-overlap",
        section="2.4.3",
        experiment="fig-2.9",
        text="Figure 2.9(b) shows that the curves are almost overlapping.",
        verdict=UNJUDGED,
        why="inertia and gravity of the postures are not printed",
    ),
    Statement(
        name="2.2-table",
        section="2.4.3",
        experiment="table-2.2",
        text="In this table, we can see that the differences are below 4%.",
        verdict=UNJUDGED,
        why="inertia and gravity of the postures are not printed, and 4 % cannot fail with those that were assumed",
    ),
    Statement(
        name="2.11-velocity",
        section="2.5.1",
        experiment="fig-2.11",
        text="Figure 2.11 shows that the velocity does not exhibit significant difference between the two cases.",
        verdict=EXPLAINED,
        why="a hand of a person's stiffness that intends the same moves a compensated joint up to 70 % faster; one that reaches "
        "less keeps the velocity",
    ),
    Statement(
        name="2.11-torque",
        section="2.5.1",
        experiment="fig-2.11",
        text="The measured torque does exhibit distinct difference: the lowered magnitudes and the forward-shifted phase.",
        verdict=REPRODUCED,
    ),
    Statement(
        name="2.12-reduction",
        section="2.5.1",
        experiment="fig-2.12",
        text="This figure shows that the magnitude of the measured torque is smaller by 60 to 80 percent (Joints 0, 1, 2 and 4).",
        verdict=EXPLAINED,
        why="so on Joints 0, 2 and 4; on Joint 1 57 %, for 3.4 of the 5.5 N.m that are left are inertia, and a soft hand "
        "saves less",
    ),
    Statement(
        name="2.13-overall",
        section="2.5.2",
        experiment="fig-2.13",
        text="Figure 2.13 shows that the tracking accuracy is overall highest with MOP.",
        verdict=REPRODUCED,
    ),
    Statement(
        name="2.14-smallest",
        section="2.5.2",
        experiment="fig-2.14",
        text="Figure 2.14 also shows that MOP provides smaller tracking error than MOL, MO, and NC.",
        verdict=REPRODUCED,
    ),
)
