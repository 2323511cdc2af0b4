"""Parquet and HDF5 parts of a data set, and whose code made them."""
