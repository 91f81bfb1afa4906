"""Measures of arrays: averages, spectra, windows, uncertainties, fields at points."""
