"""The documentation is tested: everything public says what it is, names its parameters, and its examples run."""

from __future__ import annotations

import doctest
import importlib
import inspect
import pkgutil
import re
from collections.abc import Callable, Iterator
from types import ModuleType
from typing import Any

import pytest

PACKAGES = ("sloshlab", "campaigns", "acquisition", "pipelines", "studies")


def module_names() -> list[str]:
    names = []
    for package in PACKAGES:
        names.append(package)
        path = importlib.import_module(package).__path__
        names += [found.name for found in pkgutil.walk_packages(path, package + ".")]
    return [name for name in names if not any(part.startswith("_") for part in name.split("."))]


MODULES = module_names()


def rooms() -> dict[str, list[str]]:
    """Modules by the package that holds them: what a test of its own costs is more than looking at one module."""
    found: dict[str, list[str]] = {}
    for name in MODULES:
        found.setdefault(name.rpartition(".")[0] or name, []).append(name)
    return found


ROOMS = rooms()


def public_objects(module: ModuleType) -> Iterator[tuple[str, Any]]:
    """Functions, classes and methods that are defined in a module and have public names."""
    for name, item in vars(module).items():
        if name.startswith("_") or getattr(item, "__module__", None) != module.__name__:
            continue
        if inspect.isclass(item):
            yield name, item
            for inner, method in vars(item).items():
                function = getattr(method, "__func__", method)
                if not inner.startswith("_") and isinstance(function, property):
                    yield f"{name}.{inner}", function.fget
                elif not inner.startswith("_") and inspect.isfunction(function):
                    yield f"{name}.{inner}", function
        elif callable(item):
            yield name, getattr(item, "py_func", item)


def section(docstring: str, title: str) -> str | None:
    """Text of a numpydoc section, None if there is none."""
    found = re.search(rf"^{title}\n-+\n(.*?)(?=^\S[^\n]*\n-{{3,}}\n|\Z)", docstring, re.S | re.M)
    return found.group(1) if found else None


def documented_parameters(text: str) -> set[str]:
    """Names before the colons of a Parameters section; ``a, b : float`` documents two."""
    names: set[str] = set()
    for line in text.splitlines():
        if line and not line.startswith(" "):
            names |= {name.strip().lstrip("*") for name in line.split(":")[0].split(",")}
    return names


def parameters_of(item: Callable[..., Any]) -> list[str]:
    function = item.__init__ if inspect.isclass(item) else item  # type: ignore[misc]
    skipped = {"self", "cls"}
    return [name for name in inspect.signature(function).parameters if name not in skipped]


@pytest.mark.parametrize("room", ROOMS)
def test_everything_public_has_a_docstring(room: str) -> None:
    modules = [importlib.import_module(name) for name in ROOMS[room]]
    assert [module.__name__ for module in modules if not module.__doc__] == []
    missing = [
        f"{module.__name__}.{which}"
        for module in modules
        for which, item in public_objects(module)
        if not (item.__doc__ or "").strip()
    ]
    assert missing == []


@pytest.mark.parametrize("room", ROOMS)
def test_documented_parameters_are_those_of_the_signature(room: str) -> None:
    wrong = {}
    for name in ROOMS[room]:
        for which, item in public_objects(importlib.import_module(name)):
            text = section(inspect.cleandoc(item.__doc__ or ""), "Parameters")
            if text is None or (inspect.isclass(item) and item.__init__ is object.__init__):
                continue
            documented, real = documented_parameters(text), set(parameters_of(item))
            if documented != real:
                wrong[f"{name}.{which}"] = (sorted(documented - real), sorted(real - documented))
    assert wrong == {}, f"(documented but not there, there but not documented): {wrong}"


@pytest.mark.parametrize("room", ROOMS)
def test_examples_run(room: str) -> None:
    failed = {name: n for name in ROOMS[room] if (n := n_failed_examples(name))}
    assert failed == {}


def n_failed_examples(name: str) -> int:
    """How many examples of a module go wrong; each is printed."""
    module = importlib.import_module(name)
    finder = doctest.DocTestFinder(exclude_empty=True)
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS)
    tests = finder.find(module, name, module=module)
    for which, item in public_objects(module):
        # functions compiled by numba are no functions to the finder
        if not inspect.isclass(item) and "." not in which and not inspect.isfunction(vars(module)[which]):
            tests += finder.find(item, f"{name}.{which}", module=False, globs=vars(module).copy())
    for test in tests:
        # before each docstring a runner looks whether one of all loaded sources has changed
        if test.examples:
            runner.run(test)
    return int(runner.summarize(verbose=False).failed)


def test_the_checks_see_what_they_look_for() -> None:
    """A section is found, its names are read, and there are examples at all."""
    text = section(
        "Do it.\n\nParameters\n----------\na, b : float\n    Two.\n*rest : int\n\nReturns\n-------\nint\n",
        "Parameters",
    )
    assert documented_parameters(text or "") == {"a", "b", "rest"}
    assert len(MODULES) > 50
    finder = doctest.DocTestFinder(exclude_empty=True)
    examples = sum(len(test.examples) for name in MODULES for test in finder.find(importlib.import_module(name)))
    assert examples > 40
