"""Cases whose truths somebody else holds: folder, truths, commitments to them, and answers that are frozen."""
