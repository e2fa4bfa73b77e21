"""Model selection: which effects beside the retuned baseline describe the recordings, by one search."""
