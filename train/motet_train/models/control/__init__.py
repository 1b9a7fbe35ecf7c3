"""Nets that control figures live."""
