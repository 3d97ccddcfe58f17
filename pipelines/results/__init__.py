"""The results of a study: one page in Markdown with its figures, tables, claims and numbers.

``parts`` (what the lake holds of a study) → ``groups`` (evaluations over training seeds) →
``measures``, ``ratios`` → chapters (``claims``, ``overview``, ``data``, ``training``, ``modes``,
``comparison``, ``variants``, ``rollouts``) → ``markdown`` → ``build``.
"""

from pipelines.results.build import results
from pipelines.results.parts import Part, found_parts

__all__ = ["Part", "found_parts", "results"]
