"""The error of training data."""

from motet.errors import MotetError


class DataError(MotetError, ValueError):
    """Training data that a model cannot be trained on."""
