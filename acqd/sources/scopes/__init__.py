"""Binary files of oscilloscopes: one trace a file (LeCroy, Tektronix), or several (Rigol and others)."""
