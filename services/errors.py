"""The errors of ``services``: one class per decision a caller can take.

Every message names the object, the cause and the mend, in one line.
"""


class ServiceError(Exception):
    """Root of all errors raised on purpose by ``services``."""


class HomeError(ServiceError):
    """The home folder cannot be read or written, or is of another version."""


class StoreError(ServiceError):
    """An object store cannot be reached, refuses us, or does not keep two writers apart."""


class LakeError(ServiceError):
    """A table is missing, a row breaks its schema, or a query is not allowed."""


class LostVersionError(LakeError):
    """A version of a table can never be read again; another one has to be chosen."""


class OutputError(ServiceError):
    """A file that was asked for cannot be written."""


class ClusterError(ServiceError):
    """A cluster cannot be reached, or its work failed for good."""


class ClusterLostError(ClusterError):
    """A cluster that was there is gone; what it held is to be done again on another."""


class ClusterRefusedError(ClusterError):
    """A cluster answers and refuses our token."""


class UnknownJobError(ClusterError):
    """The cluster knows no job of this id."""


class JobExistsError(ClusterError):
    """The cluster has a job of this id already; choose another one."""


class LeftRunningError(ClusterError):
    """The user stopped waiting for a job; it goes on without."""


class ProfileError(ServiceError):
    """The user's settings file or a profile in it is wrong or missing."""


class TrackingError(ServiceError):
    """The experiment tracker cannot be reached or refuses a record."""
