"""Runs: begun, gone on with, repeated, watched."""
