"""Statements of chapter 4 of Iwatani 2017 about its figures."""

from __future__ import annotations

from backdrive.thesis.statement import CONTRADICTED, EXPLAINED, REPRODUCED, UNJUDGED, Statement

PUT_IN = "the measured friction is printed as a picture without numbers: that of a simulated joint is put in"
SHAKES = "the filter as printed shakes the joint; with m = 2 kg and two filters in a row it comes out"
ARM = "m, b, gains and filter of Joint 0 are not printed"

CHAPTER_4: tuple[Statement, ...] = (
    Statement(
        name="4.3-setup-a",
        section="4.2.2",
        experiment="fig-4.3",
        text="In Setup A as shown in Figure 4.3(a), F_p != F_n, and the rate-dependent friction is almost linear.",
        verdict=UNJUDGED,
        why=PUT_IN,
    ),
    Statement(
        name="4.3-setup-b",
        section="4.2.2",
        experiment="fig-4.3",
        text="In Setup B as shown in Figure 4.3(b), the curve is almost symmetric with respect to v = 0.",
        verdict=UNJUDGED,
        why=PUT_IN,
    ),
    Statement(
        name="4.7-closest",
        section="4.6.1",
        experiment="fig-4.7",
        text="This figure shows that the curve in the estimator P is the closest to the curve of the force sensor.",
        verdict=REPRODUCED,
    ),
    Statement(
        name="4.7-late",
        section="4.6.1",
        experiment="fig-4.7",
        text="In the estimator CT, the response of the estimator was delayed due to the dead zone.",
        verdict=REPRODUCED,
    ),
    Statement(
        name="4.7-steady",
        section="4.6.1",
        experiment="fig-4.7",
        text="In the estimator HA, there is steady state error in the estimation after the motion stops.",
        verdict=REPRODUCED,
    ),
    Statement(
        name="4.8-smallest",
        section="4.6.2",
        experiment="fig-4.8",
        text="This figure shows that the external force measured by the force sensor is smallest with the estimator P.",
        verdict=EXPLAINED,
        why=f"P and HA are alike: {SHAKES}",
    ),
    Statement(
        name="4.8-alike",
        section="4.6.2",
        experiment="fig-4.8",
        text="The position trajectories are similar to each other (Figure 4.8).",
        verdict=REPRODUCED,
    ),
    Statement(
        name="4.8-threshold",
        section="4.6.2",
        experiment="fig-4.8",
        text="In the case CT, larger force is required due to estimation errors caused by the velocity threshold.",
        verdict=REPRODUCED,
    ),
    Statement(
        name="4.9-equilibrium",
        section="4.6.2",
        experiment="fig-4.9",
        text="In Figure 4.9(a), the estimated external force is almost zero in the static friction state, while the estimated "
        "friction force and the actuator force are not zero.",
        verdict=EXPLAINED,
        why=SHAKES,
    ),
    Statement(
        name="4.10-closer",
        section="4.6.2",
        experiment="fig-4.10",
        text="From Figure 4.10, the magnitude of the measured force is closer to the value of (4.19) with the estimator P.",
        verdict=EXPLAINED,
        why=f"(4.19) through the printed filter is mostly its noise: {SHAKES}",
    ),
    Statement(
        name="4.10-lag",
        section="4.6.2",
        experiment="fig-4.10",
        text="We can see phase lags in (4.19) due to the filter in Q in all three conditions.",
        verdict=REPRODUCED,
    ),
    Statement(
        name="4.11-peaks",
        section="4.7.2",
        experiment="fig-4.11",
        text="In the case with the variable alpha, the force peaks were smallest (Setup A).",
        verdict=CONTRADICTED,
        why="the joint breaks away before the rate has gone up: algFE2 then is alpha_N",
    ),
    Statement(
        name="4.11-rest",
        section="4.7.2",
        experiment="fig-4.11",
        text="After removing the external torque, the joints were in stationary state with the variable alpha (Setup A).",
        verdict=CONTRADICTED,
        why="the filter as printed goes on shaking the joint, whatever the rate",
    ),
    Statement(
        name="4.11-nominal",
        section="4.7.2",
        experiment="fig-4.11",
        text="With nominal alpha, once the joints began to move, it was difficult to stop the joints by hand (Setup A).",
        verdict=CONTRADICTED,
        why="no more difficult than with the others: all shake",
    ),
    Statement(
        name="4.11-equal",
        section="4.7.2",
        experiment="fig-4.11",
        text="The force peaks with nominal alpha were almost equivalent to the case with the variable alpha (Setup A).",
        verdict=REPRODUCED,
    ),
    Statement(
        name="4.11-high",
        section="4.7.2",
        experiment="fig-4.11",
        text="In the case with high alpha, the force peaks were larger than the other cases (Setup A).",
        verdict=CONTRADICTED,
        why="alike with all three: the filter as printed shakes the joint, and so breaks it away",
    ),
    Statement(
        name="4.11-arm",
        section="4.7.2",
        experiment="fig-4.11",
        text="We can see mostly the same features in Setup A and Setup B (Joint 0).",
        verdict=UNJUDGED,
        why=ARM,
    ),
)
