"""Replanners: from tasks to segments in one call, one interface for all (Sec. 3.3, 4.3, 5.1).

Parts, each importing only from those before it: ``replanner`` (the interface); ``unimodal``,
``latent_mode`` and ``trajectory_library`` (the three of the paper); ``plan_cost`` and ``selecting``
(the cheapest of several plans); ``build`` (from a model and data), ``artifact`` (in one folder).
"""
