"""Datasets as files: folders, zips and NetCDF, and how files from strangers are read."""
