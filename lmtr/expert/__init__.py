"""The expert: trajectory optimisation from a noisy initial guess (Sec. 3.1, 4.1–4.2).

``solve`` is the way in. The problem is written in ``formulation``, its table of contents:
``variables`` (what is optimised), ``quantities`` (what constraints speak of, linear in the
variables), ``constraints`` and ``costs`` (lists of small ``element`` functions, with ``gating``
for forces and feet at a time, ``stances`` for the points of a stance's force, and ``timing`` for
which samples meet which phases). ``assembly`` turns elements into the solver's functions with
exact derivatives, ``compilation`` into machine code, and ``solver`` hands them to IPOPT.

``docs/formulation.md`` derives all of it; what is cited as (E…) are its equations.

Reference of the approach: Winkler et al., "Gait and trajectory optimization for legged systems
through phase-based end-effector parameterization", RA-L 2018.
"""
