"""Many motion files: which are meant, what a verb answers of each, and parts of such work on many machines."""
