"""Statements of chapter 3 of Iwatani 2017 about its figures."""

from __future__ import annotations

from backdrive.thesis.statement import CONTRADICTED, EXPLAINED, REPRODUCED, UNJUDGED, Statement

PUT_IN = "the measured friction is printed as a picture without numbers: that of a simulated joint is put in"
TIE = "CD dithers after every stop, once equality in (3.27e) counts as stuck, and then does what PD does"
NEAR = "with K_c = K the compensator cancels the transmission's stiffness, and all cases but NC come near each other"

CHAPTER_3: tuple[Statement, ...] = (
    Statement(
        name="3.3-silent",
        section="3.2.2",
        experiment="fig-3.3",
        text="Figure 3.3(a) shows that the measured displacement of Setup A is zero as long as the actuator force is "
        "smaller than 6 N.",
        verdict=EXPLAINED,
        why="6 N is one count of K = 1.2e6 N/m: the joint had just passed an edge of its encoder, or K_c is 2K",
    ),
    Statement(
        name="3.3-presliding",
        section="3.2.2",
        experiment="fig-3.3",
        text="In Figure 3.3(b), Joint 0 of Setup B exhibits significant presliding displacement under small actuator torque.",
        verdict=REPRODUCED,
    ),
    Statement(
        name="3.4-setup-a",
        section="3.2.3",
        experiment="fig-3.4",
        text="Figure 3.4(a) shows that, in Setup A, F_p != F_n and the curve is almost straight.",
        verdict=UNJUDGED,
        why=PUT_IN,
    ),
    Statement(
        name="3.4-setup-b",
        section="3.2.3",
        experiment="fig-3.4",
        text="Figure 3.4(b) shows that, in Setup B, the magnitude of friction is almost symmetric.",
        verdict=UNJUDGED,
        why=PUT_IN,
    ),
    Statement(
        name="3.6-counts",
        section="3.4.2",
        experiment="fig-3.6",
        text="A sinusoidal dither such as the top of Figure 3.6 causes the displacement in two counts in each direction.",
        verdict=EXPLAINED,
        why="8 N stretch 1.2e6 N/m by 1.3 counts; from 28 % of resting places it is two, with F_n = F_p = 12 N from all",
    ),
    Statement(
        name="3.7-smallest",
        section="3.5.1",
        experiment="fig-3.7",
        text="In this figure, the peak values of the external force are smaller in the case with PD through this experiment.",
        verdict=CONTRADICTED,
        why=TIE,
    ),
    Statement(
        name="3.7-reversal",
        section="3.5.1",
        experiment="fig-3.7",
        text="In the cases of C and CD, the force peaks appear at each velocity reversal, where the actuator opposes the hand.",
        verdict=REPRODUCED,
    ),
    Statement(
        name="3.7-speed",
        section="3.5.1",
        experiment="fig-3.7",
        text="One can also see that the velocity peaks in the case of C are larger than in the cases of CD, P and PD.",
        verdict=REPRODUCED,
    ),
    Statement(
        name="3.8-smallest",
        section="3.5.1",
        experiment="fig-3.8",
        text="This figure displays that the average value is smallest in the case of PD.",
        verdict=CONTRADICTED,
        why=f"{TIE}; {NEAR}",
    ),
    Statement(
        name="3.8-dither",
        section="3.5.1",
        experiment="fig-3.8",
        text="It can be seen that the force is smaller in the case with dither: P and PD, or C and CD.",
        verdict=CONTRADICTED,
        why=f"CD is 6 N below C; P and PD are alike: {NEAR}",
    ),
    Statement(
        name="3.8-direction",
        section="3.5.1",
        experiment="fig-3.8",
        text="The average values and the standard deviations of the force peaks are different in each direction.",
        verdict=CONTRADICTED,
        why="without compensation they are; the other cases compensate each direction's own friction, 12 and 8 N, and what is left "
        "does not differ",
    ),
    Statement(
        name="3.8-test",
        section="3.5.1",
        experiment="fig-3.8",
        text="*** stands for the significant difference at p < 0.1 % according to Student's t-test (caption).",
        verdict=CONTRADICTED,
        why="against CD and P there is none",
    ),
    Statement(
        name="3.9-smallest",
        section="3.5.2",
        experiment="fig-3.9",
        text="Figures 3.9 and 3.10 show the same features as the results from Setup A (through the experiment).",
        verdict=CONTRADICTED,
        why="so along y; along x CD is the smallest as often",
    ),
    Statement(
        name="3.10-smallest",
        section="3.5.2",
        experiment="fig-3.10",
        text="The average value is smallest in the case PD, where the proposed compensator with the dither was used.",
        verdict=CONTRADICTED,
        why="PD is far below NC, C and P where the arm is led around a square, and level with CD, which dithers after every stop "
        "too",
    ),
    Statement(
        name="3.11-peaks",
        section="3.6.2",
        experiment="fig-3.11",
        text="With the proposed algorithm algFC2, the force peaks were smaller than the other cases (Figure 3.11, both setups).",
        verdict=CONTRADICTED,
        why="at rest algFC2 is alpha_N, and cannot be lighter; a joint that hunts with alpha_N has broken away already",
    ),
    Statement(
        name="3.11-rest",
        section="3.6.2",
        experiment="fig-3.11",
        text="With algFC2 the joint eventually came to stationary (Figure 3.11, both setups).",
        verdict=CONTRADICTED,
        why="so on Joint 0, with 19 of 20 hands; on Setup A, where V_W exceeds alpha_H F/K, with none",
    ),
    Statement(
        name="3.11-nominal",
        section="3.6.2",
        experiment="fig-3.11",
        text="In contrast, with the nominal alpha the fluctuation continued (Figure 3.11, both setups).",
        verdict=REPRODUCED,
    ),
    Statement(
        name="3.11-high",
        section="3.6.2",
        experiment="fig-3.11",
        text="With the high alpha the force peaks were larger (Figure 3.11, both setups).",
        verdict=REPRODUCED,
    ),
)
