"""What writing and reading share: numbers of Apache Parquet's format (parquet.thrift, format 2.10)."""

from __future__ import annotations

from typing import Any

import numpy as np

MAGIC = b"PAR1"
WRITER = "acqd"
"""The first word of `created_by`."""
BOOLEAN, INT64, DOUBLE, BYTE_ARRAY = 0, 2, 5, 6
REQUIRED = 0
PLAIN, RLE, RLE_DICTIONARY = 0, 3, 8
GZIP = 2
DATA_PAGE, DICTIONARY_PAGE = 0, 2
GZIP_WINDOW = 31
"""zlib's number of a gzip stream with the longest window."""
UNITS = "units"
"""Key of the file's metadata: units by column, as JSON."""
INDEX_TYPES: dict[int, np.dtype[Any]] = {8: np.dtype("<u1"), 16: np.dtype("<u2"), 32: np.dtype("<u4")}
"""Numbers of labels by their width in bits: widths in which packed bits are whole numbers."""
