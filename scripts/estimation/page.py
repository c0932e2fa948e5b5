"""Text of docs/estimation.md; the tables and figures follow it."""

PAGE = """# State estimation

Where is the rod, and how does it move, when all there is are camera frames that are noisy, late, sometimes lost, and
show only its tip? This page says which estimator suits what, and measures them on twins of the paper's experiments.

- The tip at the moment of a frame is enough, and 0.05 mm is: take the frame itself ([cameras](cameras.md)).
- Shape, velocity, nodes that nobody sees, the time between frames, or a modulus that is not known well:
  `EnsembleFilter` ([ensemble and unscented filters](ensemble_filter.md)).
- The same with little time and no random draws: `UnscentedFilter` (same page).
- The paper's own estimator, with a modulus that was tuned to the rod: `PredictionFilter`
  ([prediction filter](prediction_filter.md)). It is derived there, with the slips of its printed equations.

All of them take the same `Measurement` and have `reset`, `predict`, `update`, `positions`, `velocities` and
`uncertainty`; `CameraStream` makes the frames. Tables and figures are printed by `python -m scripts.estimate`.

## What is compared

**Truths.** Each of the paper's experiments 1 to 6, with the starts and fields of [the reproduction](reproduction.md).
*Helical* truths have 18 elements, an implicit integrator, Kelvin-Voigt damping (2 ms; 10 us for aluminium), quadratic
air drag of 2 |v| v per metre, about ten times that of air, and 0.8, 1 or 1.2 times the modulus of the model. *Nodal*
truths have the paper's element, 18 of them with frequency shaping, and the air drag alone, since that element has no
internal damping. None of these dampings is in any model: the prediction filter's has none, the ensemble's has a linear
drag of 1 /s with an unknown factor. At large bends the nodal element measures curvature otherwise (2 tan(theta/2) for
theta), which no parameter of the models can stand for.

**Models.** 6 elements, explicit steps. Those of the aluminium rods are conditioned (`axial_softening` 64 and 256,
`rotary_scaling` 127 and 511: a first frequency 0.2 % lower), that of experiment 6 by 4 and 9. The truths are not, but
for the rotary inertia of nodal aluminium (100 and 400). The estimators know where the rod starts, not its modulus: they
begin with the model's own shape at the measured tip, or with the model's equilibrium in the starting field.

**Frames.** 0.05 mm of noise on each coordinate of the tip; in experiment 6 of both magnets. 100 a second for PDMS. The
paper does not state its rate. Aluminium swings at 37 and 18 Hz, where 100 a second would be 2.7 and 5.4 a period: there
it is 500, for 0.5 s instead of 1.5 s, and a table has 100 to 1,000.

**Errors** are absolute, from the first instant on, against the truth. "At frames" is at the moment of a frame, after it
was taken in, which is all that Table 8 can compare; "mean" and "largest" are over all instants, four from frame to
frame. *Last frame held* and *last two frames extended* are no estimators: one that is worse than these is of no use for
the tip.

**Ensemble filter.** 64 members. Unknown are the modulus (20 %, memory 1000 s), the drag (factor e^0.7, 50 s) and a load
(0.02 m/s^2, 0.5 s): less agile and more exact than the defaults, which expect loads and no drag.

## What comes out

**The ensemble filter** is below half of Table 8's mean in every experiment, axis and marker at the moments of frames, by
factors of 1.1 to 11. Between frames too it is, but for one: experiment 3 across, 0.027 mm where half of Table 8 is
0.025 mm. A single frame is off by 0.040 mm an axis, so that this means averaging about three frames while the modulus is
still being found: with the right modulus, or after the first swings, it is below, and so it is with more frames. It
finds the modulus to 0.6 % but in experiment 6, where it is slow motion (2 %) and the nodal truth bends otherwise (5 %).
Its errors are lowest where a frame says least: velocities are 3 to 6 times better than differences of two frames in
experiment 4 and more elsewhere, and the unseen middle of the rod is known better than the tip. Table 8's largest errors
are exceeded in experiments 1, 2 and 4: in the first instants, before the modulus is known.

**The paper's filter** is at or below its printed mean in experiments 4, 5 and 6 if the modulus is right, whatever the
damping, and within 20 % of it in 1, 2 and 3 (acceptance table at the command). With the modulus 20 % off it is above in
all, by up to fifteen times; it is then worse than extending two frames. Why:

- *It needs a tuned modulus.* K acts on velocity. A wrong modulus is a force that depends on place, and in slow motion
  (experiments 5 and 6) no damping can make up for it; see
  [what it cannot do](prediction_filter.md#12-what-it-cannot-do). The paper tunes the modulus by the swing's frequency.
- *As printed, it needs many exact frames.* The table of its laws: at 400 exact frames a second and the right modulus,
  0.024 and 0.037 mm, below Table 8's 0.05 and 0.13 mm, and in experiment 4 even with a modulus 20 % off. With noise of
  0.05 mm at the same rate 0.22 and 0.13 mm, with the modulus off 1 mm and more. At 100 frames a second the
  extrapolation alone costs 0.4 to 0.7 mm. So the printed figures are what the law gives against frames that are taken
  for the truth, at a high rate, with a tuned modulus; not what it gives with noise of a camera.
- *More frames do not help it.* Each interval's K is found anew, from one frame; noise over a shorter interval is more
  velocity. At a fixed `damping_spread`, too, K is too weak for shorter intervals (modulus 20 % off, experiment 1:
  0.50 mm at 250, 0.65 at 500, 3.9 at 1,000 frames a second); raise it with the rate.

**Trouble.** The ensemble filter hardly notices a third of the frames lost, and frames that are 100 ms late once it knows
the rod (0.03 mm over the second half); a start that is 38 mm off is made up for within the first tenths of a second. A
sudden load is its worst case with these settings: on the circle its tip between frames is then no better than two frames
extended (0.145 and 0.124 mm). Where loads are expected, give it a larger `"acceleration"`, as
[its page](ensemble_filter.md) shows. The paper's filter survives late and lost frames, but not every wrong start; as
printed it diverges when frames are lost.

**Too few members, elements or frames** show in the table and figure of error against run time: 16 members and 4 elements
give nearly the errors of 64 and 6 at a fraction of the time.
"""
