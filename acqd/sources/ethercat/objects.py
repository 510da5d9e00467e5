"""Identities and CoE objects of the EK1100 and the EL3783 (Beckhoff's ESI data and manual)."""

from __future__ import annotations

BECKHOFF = 0x2
EK1100 = 0x044C2C52
EL3783 = 0x0EC73052
TXPDO_ASSIGN = 0x1C13
CHANNELS = 6
"""U1, I1, U2, I2, U3, I3 of one terminal."""

STATUS_PDO, SAMPLES_PDO, CHANNEL_STEP = 0x1A00, 0x1A01, 0x10
NEXT_SYNC1_PDO, SAMPLE_COUNT_PDO, RANGE_PDO = 0x1A60, 0x1A61, 0x1A63

PRODUCTS = {EK1100: "EK1100", EL3783: "EL3783", 0x0EBD3052: "EL3773", 0x50216DA9: "ELM3002"}
"""Product codes that a scan names."""


def product_name(vendor: int, product: int) -> str:
    """The terminal's name for people."""
    if vendor != BECKHOFF:
        return f"vendor {vendor:#x} product {product:#x}"
    return PRODUCTS.get(product) or f"Beckhoff {_family(product)}{product >> 16} (product {product:#010x})"


def _family(product: int) -> str:
    """Beckhoff codes the family in the low word: 0x2C52 couplers, 0x3052 terminals."""
    return {0x2C52: "EK", 0x3052: "EL"}.get(product & 0xFFFF, "product number ")


def assignment(samples_pdo: int) -> list[int]:
    """PDOs to assign for the oversampling factor number `samples_pdo`, in the order of the process image."""
    channels = [
        pdo
        for channel in range(CHANNELS)
        for pdo in (
            STATUS_PDO + CHANNEL_STEP * channel,
            SAMPLES_PDO + CHANNEL_STEP * channel + samples_pdo,
        )
    ]
    return [*channels, NEXT_SYNC1_PDO, SAMPLE_COUNT_PDO, RANGE_PDO]  # the range last: it may be missing
