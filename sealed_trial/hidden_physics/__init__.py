"""What a case may hide: every effect of the vocabulary, and physics that the vocabulary does not know."""
