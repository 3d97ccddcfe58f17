"""Import every module of packages, so that an image that lacks something is never made.

python import_all.py PACKAGE...
"""

import importlib
import pkgutil
import sys
from collections.abc import Iterator


def modules(package: str) -> Iterator[str]:
    """The names of a package's modules, but for what runs when it is imported."""
    found = importlib.import_module(package)
    for module in pkgutil.walk_packages(found.__path__, f"{package}."):
        if not module.name.endswith("__main__"):
            yield module.name


if __name__ == "__main__":
    for name in sys.argv[1:]:
        for each in modules(name):
            importlib.import_module(each)
