"""Li et al. 2018: ConvSeq2Seq, the systems it is compared with, and the protocol; its page is docs/predict.md."""
