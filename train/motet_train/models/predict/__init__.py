"""Nets that predict."""
