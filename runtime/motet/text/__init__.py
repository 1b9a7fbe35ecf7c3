"""Sentences, without a model: words and their ids, misspelt words, clauses, and numbers.

    sentence -> clauses that are shown one after another (clauses.py) -> numbers taken out of each
    (numeric_phrases.py) -> words (vocabulary.py), misspelt ones corrected (spelling.py) -> ids

Main names: Vocabulary and TextRules (vocabulary.py), parts_of (clauses.py), Quantities and quantities_of
(numeric_phrases.py).
Numbers: TextRules, which every bundle holds its own of; the others at the head of their files.
"""
