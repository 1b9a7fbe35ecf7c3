"""The experiments of Plappert et al. 2017 on describe and generate, and what they leave out."""
