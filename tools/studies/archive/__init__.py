"""The archive under kills and power failures, and what its codings cost."""
