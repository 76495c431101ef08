"""Datasets as files: folders, zips and NetCDF; uploaded NetCDF files are read in a separate process."""
