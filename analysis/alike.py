"""Whether recordings are of one instrument."""

from collections.abc import Mapping

from sautereau.analysis.errors import AnalysisError
from sautereau.rig.schema import Rig

INSTRUMENT = ("key", "jack", "plectrum", "string", "more_choirs")
"""Tables of a rig that describe the instrument."""


def check_alike(rigs: Mapping[str, Rig]) -> Rig:
    """Return the rig of several recordings of one instrument.

    Raises:
        AnalysisError: Key, jack, plectrum or string differ from those of the first recording.
    """
    (first_name, first), *others = rigs.items()
    faults = []
    for name, rig in others:
        differ = [part for part in INSTRUMENT if getattr(rig, part) != getattr(first, part)]
        if differ:
            faults.append(f"{name}: its {', '.join(differ)} differ from those of {first_name}")
    if faults:
        raise AnalysisError(
            "\n".join(
                [*faults, "these are different instruments: give recordings of one instrument"]
            )
        )
    return first
