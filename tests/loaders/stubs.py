"""Stands in for packages that a reader imports and does not need to read: any name of theirs is an empty class."""

import importlib.abc
import importlib.machinery
import sys
import types


class Names(type):
    """A class whose every name that it lacks is another such class."""

    def __getattr__(cls, name):
        if name.startswith("__"):
            raise AttributeError(name)
        return Names(name, (Empty,), {})


class Empty(metaclass=Names):
    """Takes anything, does nothing; a base for classes of the reader."""

    def __init__(self, *args, **kwargs):
        pass

class Stub(types.ModuleType):
    """A package without a file."""

    __version__ = "0.0.0"

    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        return Names(name, (Empty,), {})


class Finder(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Serves `stubs` and all below them, and `bare` packages: the files in their folder, without their `__init__.py`."""

    def __init__(self, stubs, bare):
        self.stubs, self.bare = stubs, bare

    def find_spec(self, name, path=None, target=None):
        if name in self.bare or any(name == stub or name.startswith(stub + ".") for stub in self.stubs):
            return importlib.machinery.ModuleSpec(name, self, is_package=True)
        return None

    def create_module(self, spec):
        module = Stub(spec.name)
        module.__path__ = [self.bare[spec.name]] if spec.name in self.bare else []
        return module

    def exec_module(self, module):
        pass


def stand_in(*stubs, bare=None):
    """From now on imports of `stubs` succeed, and those of `bare` (package: folder) run no `__init__.py`."""
    sys.meta_path.insert(0, Finder(stubs, bare or {}))
