"""Nets for live control."""
