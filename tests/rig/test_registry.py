"""Registries: the implementations of sautereau, and those of other installed packages."""

import math

import pytest

from sautereau.rig.errors import RigError
from sautereau.rig.registry import Registry

GROUP = "sautereau.test_things"
BUILT_IN = {"sine": "math:sin", "cosine": "math:cos"}


@pytest.fixture
def registry():
    return Registry(GROUP, "thing", BUILT_IN, RigError)


@pytest.fixture(name="install")
def install_one(tmp_path, install):
    """Put packages with entry points of the test's group on sys.path."""

    def write(package, **names):
        project = {"name": package, "version": "1.0", "entry-points": {GROUP: names}}
        install(tmp_path / package, project)

    return write


def test_names_are_in_the_order_given_then_those_of_others_sorted(registry, install):
    assert registry.names() == ["sine", "cosine"]
    install("other", tangent="math:tan", root="math:sqrt")
    assert registry.names() == ["sine", "cosine", "root", "tangent"]


def test_an_implementation_of_another_package_is_imported(registry, install):
    install("other", root="math:sqrt")
    assert registry.get("root") is math.sqrt
    assert registry.get("sine") is math.sin


def test_an_unknown_name_is_refused_with_the_closest_and_all_known(registry, install):
    install("other", root="math:sqrt")
    with pytest.raises(RigError) as caught:
        registry.get("cosin")
    for words in (
        "thing 'cosin' is unknown",
        "did you mean 'cosine'?",
        "sine, cosine, root",
        GROUP,
    ):
        assert words in str(caught.value)
    with pytest.raises(RigError) as caught:
        registry.get("xyz")
    assert "did you mean" not in str(caught.value)


@pytest.mark.parametrize("place", ["no_such_module:thing", "math:no_such_function"])
def test_a_broken_import_names_the_place_and_how_to_fix_it(registry, install, place):
    install("other", broken=place)
    with pytest.raises(RigError, match=rf"'broken' cannot be imported from '{place}'.*reinstall"):
        registry.get("broken")


def test_a_name_of_sautereau_is_reserved(registry, install):
    install("other", sine="math:tan")
    assert registry.names() == ["sine", "cosine"]
    assert registry.get("sine") is math.sin


def test_a_name_of_two_packages_is_refused(registry, install):
    install("first", root="math:sqrt")
    install("second", root="math:cbrt", tangent="math:tan")
    assert registry.names() == ["sine", "cosine", "root", "tangent"]
    with pytest.raises(
        RigError, match=r"'root' is provided by several .*'math:cbrt' and 'math:sqrt'"
    ):
        registry.get("root")
    assert registry.get("tangent") is math.tan
