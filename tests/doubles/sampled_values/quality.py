"""Quality of one value: the 32-bit word after it in the sample.

Bits: IEC 61850-7-3 lists validity (bits 0, 1), overflow 2, outOfRange 3, badReference 4, oscillatory 5,
failure 6, oldData 7, inconsistent 8, inaccurate 9, source 10, test 11, operatorBlocked 12. The UCA
guideline "9-2LE" adds derived 13 for a value that is calculated from others (the neutral). Bit n has the
weight 1 << n in the big-endian word (Wireshark packet-sv.c, Q_OVERFLOW = 1 << 2 ... Q_DERIVED = 1 << 13).

Validity has two codings, and both are on the wire. 9-2LE and old products read the two bits as a number: 1 is
invalid, 2 is reserved. IEC 61850-9-2 Ed. 2.1 (2020), table 21, numbers the bits from the other end: 2 is invalid;
libiec61850 does the same (QUALITY_VALIDITY_INVALID 2, its issue 281). Wireshark 4.0.17 names 1 "invalid
(backwards compatible)" and 2 "invalid". 0 is good and 3 questionable in both. A subscriber is safe if it
takes each value but 0 as not good.
"""

from __future__ import annotations

GOOD = 0
INVALID_9_2LE = 1
INVALID_ED_2_1 = 2
QUESTIONABLE = 3
VALIDITY_MASK = 3
OVERFLOW = 1 << 2
OUT_OF_RANGE = 1 << 3
BAD_REFERENCE = 1 << 4
OSCILLATORY = 1 << 5
FAILURE = 1 << 6
OLD_DATA = 1 << 7
INCONSISTENT = 1 << 8
INACCURATE = 1 << 9
SUBSTITUTED = 1 << 10
TEST = 1 << 11
OPERATOR_BLOCKED = 1 << 12
DERIVED = 1 << 13
