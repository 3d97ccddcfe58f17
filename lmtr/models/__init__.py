"""The CVAE: its shape, loss, training and file (Sec. 3.2, 4.3).

Parts, each importing only from those before it: ``settings``; ``rows`` and ``data`` (checks);
``latent``, ``perceptron`` (NumPy inference) and ``reconstruction`` (physical errors); ``record``
(history); ``trained`` (a complete model); ``checkpoint`` (its folder); and for training ``loss``,
``cvae``, ``training``. Torch is imported by these last three alone: planning does without it.
"""
