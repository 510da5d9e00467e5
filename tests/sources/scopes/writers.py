"""Binary files of oscilloscopes, byte by byte from the makers' descriptions."""

from __future__ import annotations

import struct

import numpy as np

RATE = 10_000.0
T = np.arange(2_000) / RATE
U = 230 * np.sqrt(2) * np.cos(2 * np.pi * 50 * T)
I = 5 * np.sqrt(2) * np.cos(2 * np.pi * 50 * T - 0.5)  # noqa: E741


def lecroy(values, unit, *, channel=1, order="<", wide=True, prefix=b"#9000000000", segments=1, origin=-0.1):
    """A trace of template LECROY_2_3."""
    top = 32_000 if wide else 120
    gain = float(np.float32(np.abs(values).max() / top))
    codes = np.rint((values + 2 * gain) / gain).astype(f"{order}i2" if wide else "i1")  # an offset of two codes
    block = bytearray(346)
    block[0:8], block[16:26], block[76:84] = b"WAVEDESC", b"LECROY_2_3", b"LECROYWS"

    def put(place, kind, value):
        struct.pack_into(order + kind, block, place, value)

    put(32, "h", int(wide)), put(34, "h", int(order == "<")), put(36, "i", 346)
    put(60, "i", codes.nbytes), put(116, "i", len(codes)), put(144, "i", segments)
    put(156, "f", gain), put(160, "f", 2 * gain), put(176, "f", 1 / RATE), put(180, "d", origin)
    block[196 : 196 + len(unit)], block[244:245] = unit.encode(), b"S"
    struct.pack_into(order + "dbbbbh", block, 296, 12.25, 15, 10, 21, 6, 2023)
    put(344, "h", channel - 1)
    return prefix + bytes(block) + codes.tobytes()


_LONG = ("BYT_NR", "BIT_NR", "ENCDG", "BN_FMT", "BYT_OR", "WFID", "NR_PT", "PT_FMT", "XUNIT", "XINCR", "XZERO",
         "PT_OFF", "YUNIT", "YMULT", "YOFF", "YZERO")  # fmt: skip
_SHORT = ("BYT_N", "BIT_N", "ENC", "BN_F", "BYT_O", "WFI", "NR_P", "PT_F", "XUN", "XIN", "XZE", "PT_O", "YUN", "YMU",
          "YOF", "YZE")  # fmt: skip


def isf(values, unit, *, channel=1, short=False, kind="RI", wide=2, order="MSB", form="Y"):
    """A trace of Tektronix's internal format."""
    scale = np.abs(values).max() / (30_000 if wide == 2 else 100)
    middle = 0 if kind == "RI" else 32_768 if wide == 2 else 128
    codes = np.rint(values / scale + middle + 3)
    data = codes.astype(f"{'<' if order == 'LSB' else '>'}{'i' if kind == 'RI' else 'u'}{wide}").tobytes()
    label = f'"Ch{channel}, DC coupling, 1.0E1 {unit}/div, 2.0E-2 s/div, {len(values)} points: Sample mode"'
    said = [wide, 8 * wide, "BIN", kind, order, label, len(values), form, '"s"', 1 / RATE, -0.1, 0, f'"{unit}"',
            float(scale), float(middle + 3), 0.0]  # fmt: skip
    items = [f"{key} {value}" for key, value in zip(_SHORT if short else _LONG, said, strict=True)]
    head = (":WFMP:" if short else ":WFMPRE:") + ";".join(items)
    count = str(len(data))
    return f"{head};:{'CURV' if short else 'CURVE'} #{len(count)}{count}".encode() + data


def tektronix_wfm(values, unit, *, channel=1, version=3, order="<", wide=2, before=0):
    """One curve (Reference Waveform File Format, 077-0220) with `before` samples of precharge."""
    del channel  # the file does not say it
    scale = np.abs(values).max() / (30_000 if wide == 2 else 120)
    codes = np.rint(np.append(np.zeros(before), values) / scale).astype(f"{order}i{wide}")
    explicit, view = (166 if version == 1 else 168), (60 if version == 3 else 56)
    implicit = explicit + 2 * (100 + view)
    curve = implicit + 2 * (76 + view) + 48
    head = bytearray(curve + 30)

    def put(place, kind, value):
        struct.pack_into(order + kind, head, place, value)

    put(0, "H", 0x0F0F if order == "<" else 0xF0F0)
    head[2:10] = b":WFM#00%d" % version
    put(10, "B", 7), put(11, "i", len(head) + codes.nbytes - 15), put(15, "B", wide), put(16, "i", len(head))
    put(76, "H", len(head)), put(78, "i", 0), put(82, "I", 1), put(114, "I", 1), put(118, "I", 1), put(122, "I", 2)
    put(142, "I", 1), put(explicit, "d", float(scale)), put(explicit + 8, "d", 0.0), put(explicit + 16, "I", 65_536)
    head[explicit + 20 : explicit + 20 + len(unit)] = unit.encode()
    put(explicit + 72, "i", 0 if wide == 2 else 7)
    put(implicit, "d", 1 / RATE), put(implicit + 8, "d", -0.1), put(implicit + 16, "I", len(codes))
    head[implicit + 20 : implicit + 21] = b"s"
    begin, end = before * wide, codes.nbytes
    for place, value in ((10, 0), (14, begin), (18, end), (22, end), (26, end)):
        put(curve + place, "I", value)
    return bytes(head) + codes.tobytes()
