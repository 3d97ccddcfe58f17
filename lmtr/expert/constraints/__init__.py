"""Constraints of the expert's problem, one physical idea per module (Sec. 4.1)."""
