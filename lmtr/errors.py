"""The errors of ``lmtr``: one class per decision a caller can take.

Every message names the object, the rule, the value received and the mend, in one line.
"""


class LmtrError(Exception):
    """Root of all errors raised on purpose by ``lmtr``."""


class ConfigurationError(LmtrError):
    """A setting is unknown, out of range or contradicts another one: mend the configuration."""


class TaskError(LmtrError):
    """A locomotion task is malformed or impossible: mend the task or its distribution."""


class DataError(LmtrError):
    """Data are missing, non-finite or of another layout: make them again or choose others."""


class ModelError(LmtrError):
    """A model does not fit its data, layout or file: train it again or choose another one."""


class CompilationError(LmtrError):
    """No machine code can be made here: mend compiler or cache, or do without."""
