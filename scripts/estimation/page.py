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

**The ensemble filter** is below half of Table 8's mean in every experiment, axis and marker at the moments of frames.
Between frames too it is, but for one: experiment 3 across, 0.027 mm where half of Table 8 is 0.025 mm. A single frame
is off by 0.040 mm an axis, and in that experiment the modulus must be found within the first of nine swings: over the
second half of the run the same error is 0.021 to 0.024 mm (helical truths). It finds the modulus to about
1 %, but in experiment 6, whose slow motion tells it to 2 %, and 5 % where the truth bends otherwise. It adds most
where a frame says least: velocities are 6 to 40 times better than differences of two frames,
and the unseen middle of the rod is known better
than the tip. Table 8's largest errors are exceeded in experiments 1, 2 and 4, in the first instants, before the
modulus is known. Its worst truth is the nodal one of experiment 4, at large bends: 0.11 mm.

**The paper's filter** with the right modulus, whatever the damping, is at or below its printed mean at frames in
experiments 1, 4, 5 and 6; in 2 and 3 it is 18 % and 7 % above along z (0.059 and 0.054 mm for 0.05),
between frames 21 % and 42 %. With the modulus 20 % off it is above in nearly all, by factors up to more than ten,
and then worse than two frames extended. Why:

- *It needs a tuned modulus.* K acts on velocity. A wrong modulus is a force that depends on place, and in slow motion
  (experiments 5 and 6) no damping makes up for it: see
  [what it cannot do](prediction_filter.md#12-what-it-cannot-do). The paper tunes its modulus by the swing's
  frequency.
- *As printed, it needs many exact frames.* See the table of its laws: with 400 exact frames a second and the right
  modulus the printed law is off by 0.024 and 0.037 mm (experiments 3 and 4), below Table 8's 0.05 and 0.13 mm; in
  experiment 4 even with a modulus 20 % off. With noise of 0.05 mm at the same rate it is off by 0.22 and 0.13 mm, and
  by more than 1 mm if the modulus is, too. At 100 frames a second the extrapolation costs 0.4 to 0.7 mm, without any
  noise. The printed figures are what the law can give with a tuned modulus against many frames that are next to
  exact, and not what it gives with this noise.
- *Comparing with frames does not hide it*: estimate minus frame and estimate minus truth have nearly the same mean.
- *More frames do not help it.* Each K is found anew, from one interval, and the noise of a shorter one is more
  velocity. At a fixed `damping_spread` K is also too weak in short intervals (experiment 1, modulus 20 % off: 0.50 mm
  at 250, 0.65 at 500, 3.9 at 1,000 frames a second); raise it with the rate.

**Trouble.** The ensemble filter hardly notices that a third of the frames are lost, nor frames that are 100 ms late
once it knows the rod (0.03 mm over the second half of the run); a start that is 38 mm off is made up for. A sudden
load is its worst case with these settings: on the circle its tip between frames is then no better than two frames
extended. Where loads are expected give it a larger `"acceleration"`, as [its page](ensemble_filter.md) shows. The
paper's filter lives with late and lost frames, but not with every wrong start; as printed it diverges when frames are
lost.

**Speed.** On one core, all filters run faster than real time on the PDMS rods, the ensemble with 64 members among
them; not the ensemble on aluminium at 500 frames a second, where steps are short.
"""
