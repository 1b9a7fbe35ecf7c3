"""Motions for sentences, drawn as codes.

    sentence -> clauses and numbers (motet.text) -> context vector (the encoder) -> action and codes, step by step
    (codes.py), each step drawn with its remembered neighbours (memory.py) -> frames (codec.py) -> Generated (base.py)

A story draws its parts one after another and keeps the numbers of its sentences (story_decoder.py, measured by
motion_measures.py). A motion that no sentence describes is continued by continuation.py and its loop continue_codes.py.

Main names: CodesModel (model.py), GenerateModel and Generated (base.py), Writer (codes.py), Memory (memory.py).
Numbers: CodesSettings (codes.py), MemorySettings (memory.py), ContinuationSettings (continue_codes.py),
FamiliaritySettings (base.py), and the constants at the head of motion_measures.py.
"""
