"""Recordings in files of named arrays: MATLAB, HDF5, Parquet and Arrow, TDMS."""
