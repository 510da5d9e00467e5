"""Physical effects that can be switched on in the virtual cell, declared or undeclared.

Every subclass of `Effect` in a module of this package is an effect, and so is every entry point of the group
`acqd.lab.effects`. On the command line an effect is written `ID` or `ID:name=value,...`. The extra names `from` and
`at` give its onset: the number of a recording, and the seconds within it.
"""

from acqd.lab.effects.registry import EffectSpec, check_axes, known_effects, make_effects, parse_effect

__all__ = ["EffectSpec", "check_axes", "known_effects", "make_effects", "parse_effect"]
