"""Mode policies π: x → z and the distance between tasks that they rest on (Sec. 3.3).

Parts, each importing only from those before it: ``distance``, ``distance_bounds``,
``nearest_neighbour``, ``mode_library``, ``mode_policy``.
"""
