"""How many examples hypothesis tries: few, always the same ones, in `make test`, else many."""

from hypothesis import settings

FEW = settings(max_examples=20, deadline=None, derandomize=True)
settings.register_profile("few", FEW)
settings.register_profile("many", max_examples=200, deadline=None)


def examples(few: int, many: int) -> settings:
    """Return the settings of a test that tries other numbers of examples than the others."""
    return settings(max_examples=few if settings().derandomize else many)
