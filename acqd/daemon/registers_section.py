"""The section `[registers]`: whether there are rows of registers."""

from __future__ import annotations

from acqd.section import Section


class RegistersSection(Section):
    """Energy, reactive energy and demand, as rows of their own once a minute; the summaries always have them."""

    enabled: bool = False
