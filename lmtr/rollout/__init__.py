"""Receding-horizon rollouts of replanners over random obstacles, and their metrics (Sec. 5).

``settings`` → ``mission``, ``courses``, ``starts`` (where a rollout walks) → ``contacts`` →
``window`` (what a plan moves during one replanning period) → ``record``, ``accumulate`` (what is
kept), ``plausibility`` (what is not) → ``testbed`` (the loop). ``metrics``, ``balance`` → ``tally``
→ ``summary`` judge any :class:`~lmtr.trajectory.motion.Motion`: rollouts, and expert solutions as
the reference. ``fronts`` → ``comparison`` hold replanners against each other, by tallies alone.
"""
