"""Rivals of the diagnosis: other ways to answer the cases of a blind trial, marked by the same rules.

``python -m studies.rivals TRIAL --truths FILE --training TRIAL … -o OUT``. What a rival may see of a case is in
`baseline` (the retuned simulation and what it leaves), `force_regression` and `signal_features`, computed once a
case by `seen`; the rivals themselves are `retuned_baseline`, `sparse_regression`, `neighbours_and_forest` and
`guesses`; `training` opens the truths of development trials, `comparison` marks, `page` writes.
"""
