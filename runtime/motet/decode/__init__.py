"""Decoding loops: plain numpy over encoder and step graphs."""
