"""The science of LMTR: latent-mode trajectory regression for dynamic quadruped locomotion.

Data flows one way through the packages, and each imports only from those before it:

``geometry`` → ``robot`` → ``spline`` → ``trajectory`` → ``task`` → ``vectors`` →
``quality`` → ``expert`` → ``segmentation`` → ``models`` → ``policies`` → ``replanners`` →
``rollout`` → ``figures``. Beneath them all lie ``arrays``, ``settings``, ``streams``, ``errors``.

Nothing here knows of Ray, MLflow, DuckDB or the layout of a disk; CasADi is imported by
``expert`` alone, torch by ``models`` and what builds on it.

Conventions throughout: SI units; z up, ground at z = 0; feet in the order LF, RF, LH, RH;
angles roll, pitch, yaw with R = Rz(yaw)·Ry(pitch)·Rx(roll); frames as suffixes ``_W`` (world),
``_B`` (base) and ``_S`` (segment: on the ground under the base at the epoch, x along its yaw).
"""

__version__ = "0.1.0"
