"""Physical effects that can be switched on in the virtual cell, declared or not.

Every class derived from `Effect` in a module of this package is one; so is every entry point of the group
`acqd.lab.effects`. Orders are written `ID` or `ID:name=value,...`, with `from=` the recording number and
`at=` the second in it where the effect begins.
"""

from acqd.lab.effects.registry import EffectSpec, check_axes, known_effects, make_effects, parse_effect

__all__ = ["EffectSpec", "check_axes", "known_effects", "make_effects", "parse_effect"]
