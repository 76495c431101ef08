"""Datasets as files: folders, zips and NetCDF; uploaded files are read in a separate process."""
